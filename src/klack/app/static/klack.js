// Theme (kept in this browser), and moves of sliders that wait for the last answer.
(() => {
  const KEY = "klack-theme", order = ["auto", "light", "dark"];
  const get = () => { try { return localStorage.getItem(KEY) || "auto"; } catch { return "auto"; } };
  const apply = () => {
    const theme = get();
    if (window.Quasar) Quasar.Dark.set(theme === "auto" ? "auto" : theme === "dark");
    const button = document.getElementById("k-theme");
    if (button) { button.textContent = { auto: "Auto", light: "Light", dark: "Dark" }[theme]; }
  };
  window.klackTheme = () => {
    const next = order[(order.indexOf(get()) + 1) % order.length];
    try { localStorage.setItem(KEY, next); } catch { /* kept for this page only */ }
    apply();
  };
  const wait = setInterval(() => {
    if (document.getElementById("k-theme") && window.Quasar) { clearInterval(wait); apply(); }
  }, 30);
  // Ctrl+S saves in the editor instead of the page
  document.addEventListener("keydown", (event) => {
    const save = document.getElementById("k-save");
    if (save && (event.ctrlKey || event.metaKey) && event.key === "s") {
      event.preventDefault();
      save.click();
    }
  });
})();
