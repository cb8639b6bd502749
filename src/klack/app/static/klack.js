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
  // what is pressed before the server listens is sent once it does: say so where that takes a while
  const linking = setInterval(() => {
    const told = document.getElementById("k-link");
    if (told) told.textContent = window.did_handshake || performance.now() < 700 ? "" : "connecting ...";
    if (told && window.did_handshake) clearInterval(linking);
  }, 100);
  // what waits shows for how long, from 2 s on; it is no text: screen readers would read each second
  setInterval(() => {
    for (const found of document.querySelectorAll(".k-wait")) {
      const words = found.textContent, now = performance.now();
      if (found.waits !== words) Object.assign(found, { waits: words, since: now });
      const time = Math.floor((now - found.since) / 1000);
      found.dataset.for = time < 2 ? "" : time < 100 ? ` ${time} s` : ` ${Math.round(time / 60)} min`;
    }
  }, 500);
  // Ctrl+S saves in the editor instead of the page
  document.addEventListener("keydown", (event) => {
    const save = document.getElementById("k-save");
    if (save && (event.ctrlKey || event.metaKey) && event.key === "s") {
      event.preventDefault();
      const box = document.activeElement;
      if (box.dataset.told !== undefined) box.dispatchEvent(new Event("change", { bubbles: true }));  // half typed
      queueMicrotask(() => save.click());  // after it
    }
  });
})();
// The server makes parts of a page again; the focus, and what is half typed, stay where they were.
(() => {
  const OWN = /^c\d+$/;  // names that NiceGUI gives, other ones each time
  let last = null;
  const named = (e) => e.id && !OWN.test(e.id) ? `#${CSS.escape(e.id)}` : "";
  const same = (e) => {
    if (last.id) return e.matches(last.id);
    return e.tagName === last.tag && (e.getAttribute("aria-label") || e.textContent.trim()) === last.words;
  };
  const remember = (e) => {
    if (e.closest("[role=dialog]")) return;
    last = { e, id: named(e), tag: e.tagName, words: e.getAttribute("aria-label") || e.textContent.trim(), given: e.value };
  };
  document.addEventListener("focusin", (event) => remember(event.target));
  document.addEventListener("change", ({ target }) => queueMicrotask(() => {  // it comes at a removal, too
    if (last && last.e === target && target.isConnected) last.given = target.value;
  }));
  document.addEventListener("pointerdown", (event) => {
    if (!event.target.closest("a, button, input, select, textarea, summary, label, [tabindex], [role=dialog]")) last = null;
  });
  new MutationObserver(() => {
    if (!last || last.e.isConnected || document.activeElement !== document.body) return;
    const found = last.id ? document.querySelector(last.id) : [...document.getElementsByTagName(last.tag)].find(same);
    if (!found) return;
    const { e, given } = last, half = e.value !== given && e.value !== undefined;
    const from = e.selectionStart, to = e.selectionStart === 0 && e.selectionEnd === e.value?.length ? Infinity : e.selectionEnd;
    found.focus({ preventScroll: true });
    if (half) {
      found.value = e.value;
      last.given = given;  // still to be told at the end
    }
    if (from != null && found.value !== undefined) found.setSelectionRange(from, Math.min(to, found.value.length));
  }).observe(document.documentElement, { childList: true, subtree: true });
})();
// The editor: changes of boxes and text are counted, and an answer that knows less of them comes too late for what they changed.
(() => {
  let count = 0, sent = [];  // values of boxes that no text from the server has yet
  const name = `klack-boxes:${location.pathname}${location.search}`;
  const store = (act) => { try { return act(sessionStorage); } catch { return null; } };
  let left = JSON.parse(store((kept) => kept.getItem(name)) ?? "[]");  // by the page before this one
  store((kept) => kept.removeItem(name));
  addEventListener("pagehide", () => {  // what is on its way may be lost
    if (sent.length) store((kept) => kept.setItem(name, JSON.stringify(sent)));
  });
  window.klackTyped = (area, longest) => {
    area.at = ++count;
    return [JSON.stringify(area.value).length > longest ? null : area.value, count, area.shown ?? 0];
  };
  window.klackChanged = ({ type, target: box }, emit) => queueMicrotask(() => {  // later than a removal, which tells both events
    const told = box.dataset.told, isLeft = type === "focusout";
    if (told === undefined || !box.isConnected || isLeft && document.activeElement === box) return;
    if (box.value !== told && box.value.trim()) {
      box.at = ++count;
      box.dataset.told = box.value;
      delete box.late;
      sent.push([box.id, box.value, count]);
      emit([box.id, box.value, count]);
    } else if (box.value !== told) {
      box.value = told;
      emit([box.id, "", count]);
    } else if (isLeft && box.late !== undefined) {
      box.value = box.dataset.told = box.late;
      delete box.late;
    }
  });
  const takeUp = () => {
    for (const [id, value] of left) {
      const box = document.getElementById(id.replace(/^n-/, "f-"));  // the form has each key
      if (!box || box.value === value) continue;
      box.value = value;
      box.dispatchEvent(new Event("change", { bubbles: true }));
    }
    left = [];
  };
  window.klackBoxes = (values, known) => {
    for (const [id, [value, instead]] of Object.entries(values)) {
      const box = document.getElementById(id);
      if (!box || box.at > known) continue;
      if (box.placeholder !== undefined) box.placeholder = instead;
      if (document.activeElement === box) box.late = value;
      else if (box.value !== value || box.dataset.told !== value) box.value = box.dataset.told = value;
    }
    if (Object.keys(values).length) takeUp();
  };
  window.klackText = (text, known, shown) => {
    const area = document.getElementById("k-yaml");
    sent = sent.filter(([, , at]) => at > known);
    if (area.at > known) return;
    area.shown = shown;
    area.told(text);  // the cursor stays
  };
  addEventListener("beforeunload", () => document.activeElement?.blur());  // half typed: told before the page goes
})();
// The second click of a double click is for what the first one has hit: not for what has come under the pointer since, nor for what starts but once.
(() => {
  let presses = 0, first = { at: -1e9 };
  document.addEventListener("pointerdown", () => { presses++; }, true);
  document.addEventListener("click", (event) => {
    if (!event.detail) return;  // by a key
    const hit = event.target.closest("button, a, label, summary"), { timeStamp: at, clientX: x, clientY: y } = event;
    const isSecond = presses !== first.presses && at - first.at < 500 && Math.hypot(x - first.x, y - first.y) < 5;
    if (!isSecond) first = { at, x, y, presses, hit };
    else if (hit !== first.hit || hit?.dataset.once !== undefined) {
      event.preventDefault();
      event.stopImmediatePropagation();
    }
  }, true);
})();
// The Tab key goes round within a dialog.
document.addEventListener("keydown", (event) => {
  const dialogs = event.key === "Tab" ? document.querySelectorAll("[role=dialog][aria-modal=true]") : [];
  if (!dialogs.length) return;
  const dialog = dialogs[dialogs.length - 1];
  const found = [...dialog.querySelectorAll("a[href], button, input, select, textarea, summary, [tabindex='0']")]
    .filter((e) => !e.disabled && e.checkVisibility());
  if (!found.length) return;
  const first = found[0], last = found[found.length - 1], now = document.activeElement;
  const to = !dialog.contains(now) ? first : event.shiftKey && !found.slice(1).includes(now) ? last : !event.shiftKey && now === last ? first : null;
  if (to) { event.preventDefault(); to.focus(); }
});
// Without the server: what is typed into the text of a case is kept in this tab, for a page that comes in place of this one.
(() => {
  const key = () => `klack-text:${location.pathname}${location.search}`;
  const stored = (act) => { try { return act(sessionStorage, key()); } catch { return null; } };  // no room: it stays in the page
  const area = () => document.getElementById("k-yaml");
  const connected = () => window.socket?.connected && window.did_handshake;
  let left = stored((store, name) => store.getItem(name));  // by the page before this one
  document.addEventListener("typed", (event) => {
    if (event.target === area() && !connected()) stored((store, name) => store.setItem(name, event.target.value));
  });
  addEventListener("pagehide", () => {  // what is on its way may be lost
    const found = area();
    if (found && found.at > (found.heard ?? 0)) stored((store, name) => store.setItem(name, found.value));
  });
  const words = () => {
    const spans = document.querySelectorAll("#popup > span");
    if (spans.length !== 2) return;
    spans[0].textContent = "No connection to klack app.";
    spans[1].textContent = "Was it stopped? Start it again, and open the address that it prints. Changes on this page do not reach it; runs continue.";
    document.getElementById("popup").setAttribute("role", "status");
  };
  document.addEventListener("DOMContentLoaded", words);
  setInterval(() => {
    const found = area();
    if (!found) return;
    const text = left;
    left = null;  // once: what is typed on this page reaches the server by itself
    if (text !== null) found.value = text;
    if (connected()) stored((store, name) => store.removeItem(name));
  }, 100);
})();
// Undo and redo outside of the text.
document.addEventListener("keydown", (event) => {
  const key = event.key.toLowerCase(), isUndo = key === "z" && !event.shiftKey, isRedo = key === "y" || key === "z" && event.shiftKey;
  if (!(event.ctrlKey || event.metaKey) || event.altKey || !(isUndo || isRedo)) return;
  if (event.target.closest("input, textarea, select, [role=dialog], #k-yaml")) return;
  event.preventDefault();
  document.getElementById(isUndo ? "k-undo" : "k-redo").click();  // what a box has told comes first
});
// The schematic: component and port that a click hits.
window.klackHit = (target) => {
  const hit = target.closest("[data-name], [data-port]")?.dataset ?? {};
  return [hit.name ?? "", hit.port ?? ""];
};
window.klackShowChosen = () => requestAnimationFrame(() => requestAnimationFrame(() => {  // once it is drawn
  document.querySelector(".k-net [data-name].k-chosen")?.scrollIntoView({ block: "nearest", inline: "nearest" });
}));
