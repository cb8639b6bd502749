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
  // a STEP file to the server: its place there, or why not, in words
  window.klackUpload = async (file, largest) => {
    if (!file) return null;
    if (file.size > largest) return { name: file.name, error: `${file.name}: ${Math.ceil(file.size / 2 ** 20)} MiB, more than ${largest / 2 ** 20} MiB. Try: copy it into the folder of the application.` };
    try {
      const answer = await fetch("/upload", { method: "POST", body: file });
      const text = (await answer.text()).trim();
      return answer.ok ? { name: file.name, file: text } : { name: file.name, error: `${file.name}: ${text}` };
    } catch (error) { return { name: file.name, error: `${file.name}: ${error.message}` }; }
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
