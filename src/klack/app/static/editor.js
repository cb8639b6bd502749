// The text of a case as it is seen: line numbers, colours, and the line of an error. The text area holds the text and the cursor;
// its letters are drawn over it, only the lines in sight, so a long text costs what a short one does.
(() => {
  const AHEAD = 20;  // lines drawn above and below those in sight
  const WIDEST = 5000;  // characters of a line: a text with a longer one stays plain
  const BACK = 2000;  // lines that are read back to a line without indentation
  const GAP = 12;  // [px] above the first line, as in the style
  let area, ink, lines;  // text area, its letters, line numbers
  let starts = [0], widest = 0;  // of lines
  let marked = new Map(), first = null;  // lines of errors and doubts with their kind, and the first with its column, from 1
  let isWaiting = false;

  const part = (kind, words) => {
    const found = document.createElement("span");
    found.className = kind;
    found.textContent = words;
    return found;
  };
  const index = (text) => {
    const before = starts.length;
    starts = [0];
    widest = 0;
    for (let at = text.indexOf("\n"); at >= 0; at = text.indexOf("\n", at + 1)) {
      widest = Math.max(widest, at + 1 - starts[starts.length - 1]);
      starts.push(at + 1);
    }
    widest = Math.max(widest, text.length - starts[starts.length - 1]);
    if (starts.length !== before) marked = new Map();  // they may stand elsewhere now, the next check tells
  };
  const line = (text, number) => text.slice(starts[number], (starts[number + 1] ?? text.length + 1) - 1);

  // what stands aside (comment, blank, bracket), a quoted text, a word of YAML's own, or a value in one piece
  const TOKEN = /(#.*|\s+|[{}[\],]|:(?=\s|$)|-(?=\s|$))|("(?:[^"\\]|\\.)*"?|'(?:[^']|'')*'?)|([&*!][^\s,[\]{}]*|[|>][-+0-9]*(?=\s*(?:#.*)?$))|(?:[^\s{}[\],:]|:(?=\S))(?:[^{}[\],:\s]|:(?=\S)|\s+(?![\s#:{}[\],]|$))*/g;
  const KEY = /^\s*:(\s|$)/;
  const QUANTITY = /^[-+]?\.?\d/;
  const BLOCK = /(?:^|[\s:-])[|>][-+0-9]*\s*(?:#.*)?$/;
  const depth = (text) => text.search(/\S|$/);
  const coloured = (text) => [...text.matchAll(TOKEN)].map(({ 0: words, 1: aside, 2: quote, 3: own, index: at }) => {
    const kind = !words.trim() ? "" : aside ? "k-aside" : KEY.test(text.slice(at + words.length)) ? "k-key" : quote || own ? "k-words" : QUANTITY.test(words) ? "k-number" : "";
    return kind ? part(kind, words) : words;
  });
  // indentation of the key whose block of text goes on behind a line, or -1
  const block = (text, within) => {
    if (within >= 0 && (!text.trim() || depth(text) > within)) return within;
    return BLOCK.test(text) && !text.trimStart().startsWith("#") ? depth(text) : -1;
  };
  const drawn = (text, from, to) => {
    let begin = from, within = -1;
    while (begin > 0 && begin > from - BACK && !/[^\s#]/.test(text[starts[begin]] ?? " ")) begin--;
    for (; begin < from; begin++) within = block(line(text, begin), within);
    const found = [];
    for (let number = from; number < to; number++) {
      const words = line(text, number), isText = within >= 0 && (!words.trim() || depth(words) > within);
      within = block(words, within);
      const parts = isText ? [part("k-words", words)] : coloured(words);
      if (marked.has(number)) {
        const wrong = part(marked.get(number), "");
        wrong.append(...parts);
        found.push(wrong, "\n");
      } else found.push(...parts, "\n");
    }
    return found;
  };
  const rowHeight = () => {  // measured: heights are rounded otherwise at each zoom
    const all = area.scrollHeight - 2 * GAP, one = parseFloat(getComputedStyle(area).lineHeight);
    return area.scrollHeight > area.clientHeight ? all / starts.length : one;
  };
  const put = (layer, parts, top, height, width = 0) => {
    const inner = layer.firstElementChild, block = inner.firstElementChild;
    inner.style.height = `${height}px`;
    if (width) inner.style.width = `${width}px`;
    block.style.top = `${top}px`;
    block.replaceChildren(...parts);
    layer.scrollTop = area.scrollTop;
    layer.scrollLeft = area.scrollLeft;
  };
  const draw = () => {
    isWaiting = false;
    const text = area.value, row = rowHeight(), { scrollTop, scrollHeight, scrollWidth, clientHeight, clientWidth } = area;
    const from = Math.max(0, Math.floor((scrollTop - GAP) / row) - AHEAD);
    const to = Math.min(starts.length, Math.ceil((scrollTop + clientHeight) / row) + AHEAD);
    const numbers = [];
    for (let number = from; number < to; number++) {
      numbers.push(marked.has(number) ? part(marked.get(number), `! ${number + 1}`) : `${number + 1}`, "\n");
    }
    const isPlain = widest > WIDEST;
    area.classList.toggle("k-drawn", !isPlain);
    ink.style.width = `${clientWidth}px`;  // without its scroll bars
    ink.style.height = `${clientHeight}px`;
    lines.style.width = `${Math.max(3, String(starts.length).length) + 3}ch`;
    put(ink, isPlain ? [] : drawn(text, from, to), GAP + from * row, scrollHeight, scrollWidth);
    put(lines, numbers, GAP + from * row, scrollHeight + area.offsetHeight - clientHeight);
  };
  const soon = () => {
    if (!isWaiting) requestAnimationFrame(draw);
    isWaiting = true;
  };
  const changed = () => {
    index(area.value);
    soon();
  };
  // whether the page has its text by now
  const begun = () => {
    if (area) return true;
    [area, ink, lines] = ["k-yaml", "k-ink", "k-lines"].map((id) => document.getElementById(id));
    if (!area) return false;
    for (const layer of [ink, lines]) layer.innerHTML = "<div><div></div></div>";
    changed();
    new ResizeObserver(soon).observe(area);
    document.fonts.ready.then(soon);
    return true;
  };
  const wait = setInterval(() => { if (begun()) clearInterval(wait); }, 30);
  for (const [kind, act] of [["input", changed], ["scroll", soon]]) {
    document.addEventListener(kind, ({ target }) => { if (target.id === "k-yaml" && begun()) act(); }, true);
  }
  window.klackDrawn = () => { if (begun()) changed(); };  // the text is another one without an event

  // lines and columns, from 1, of what the checker says of a text, and the kinds of their marks; an error comes first
  window.klackMarks = (places, known) => {
    if (!begun() || area.at > known) return;
    area.heard = known;
    index(area.value);
    marked = new Map(places.map(([number, , kind]) => [number - 1, kind]));
    [first = null] = places;
    area.setAttribute("aria-invalid", first?.[2] === "k-wrong");
    soon();
  };
  window.klackGo = () => {
    if (!begun() || !first?.[0]) return;
    const number = Math.min(first[0], starts.length) - 1;
    const at = starts[number] + Math.min(Math.max(first[1] - 1, 0), line(area.value, number).length);
    area.focus({ preventScroll: true });
    area.setSelectionRange(at, at);
    area.scrollTop = GAP + (number + 0.5) * rowHeight() - area.clientHeight / 2;
    area.scrollLeft = 0;
    area.scrollIntoView({ block: "nearest" });
  };
})();
// Undo and redo: one history of what is typed, and of what the form and the schematic change, as pieces of the text.
(() => {
  const MOST = 2000;  // changes
  let area = null, last = "", done = [], undone = [];
  const piece = (old, text) => {
    let from = 0, end = 0;
    const most = Math.min(old.length, text.length);
    while (from < most && old[from] === text[from]) from++;
    while (end < most - from && old[old.length - 1 - end] === text[text.length - 1 - end]) end++;
    return { from, removed: old.slice(from, old.length - end), added: text.slice(from, text.length - end) };
  };
  // letters of a word are one change
  const goesOn = (first, next) => first?.isTyped && next.isTyped && !first.removed && !next.removed &&
    next.added.length === 1 && /\S/.test(next.added) && /\S$/.test(first.added) && next.from === first.from + first.added.length;
  const note = (isTyped) => {
    if (area.value === last) return;
    const found = { ...piece(last, area.value), isTyped }, before = done[done.length - 1];
    if (!undone.length && goesOn(before, found)) before.added += found.added;
    else done.push(found);
    if (done.length > MOST) done.shift();
    undone = [];
    last = area.value;
  };
  const put = (from, old, text) => {
    area.setRangeText(text, from, from + old.length, "end");
    last = area.value;
    area.dispatchEvent(new Event("input", { bubbles: true }));
  };
  const begun = () => {
    if (area) return true;
    area = document.getElementById("k-yaml");
    if (area) last = area.value;
    return area !== null;
  };
  window.klackNoted = () => { if (begun()) note(false); };
  window.klackUndo = () => {
    const found = begun() && done.pop();
    if (!found) return;
    undone.push(found);
    put(found.from, found.added, found.removed);
  };
  window.klackRedo = () => {
    const found = begun() && undone.pop();
    if (!found) return;
    done.push({ ...found, isTyped: false });
    put(found.from, found.removed, found.added);
  };
  const wait = setInterval(() => { if (begun()) clearInterval(wait); }, 30);
  document.addEventListener("input", ({ target }) => { if (begun() && target === area) note(true); }, true);
  document.addEventListener("beforeinput", (event) => {
    const act = { historyUndo: window.klackUndo, historyRedo: window.klackRedo }[event.inputType];
    if (!act || event.target.id !== "k-yaml") return;
    event.preventDefault();
    act();
  });
  document.addEventListener("keydown", (event) => {
    const key = event.key.toLowerCase(), isUndo = key === "z" && !event.shiftKey, isRedo = key === "y" || key === "z" && event.shiftKey;
    if (!(event.ctrlKey || event.metaKey) || event.altKey || !(isUndo || isRedo) || !begun()) return;
    if (event.target !== area && event.target.closest("input, textarea, select, [role=dialog]")) return;
    event.preventDefault();
    if (event.target !== area) document.getElementById(isUndo ? "k-undo" : "k-redo").click();  // what a box has told comes first
    else (isUndo ? window.klackUndo : window.klackRedo)();
  });
})();
// The schematic: component and port that a click hits.
window.klackHit = (target) => {
  const hit = target.closest("[data-name], [data-port]")?.dataset ?? {};
  return [hit.name ?? "", hit.port ?? ""];
};
window.klackShowChosen = () => requestAnimationFrame(() => requestAnimationFrame(() => {  // once it is drawn
  document.querySelector(".k-net [data-name].k-chosen")?.scrollIntoView({ block: "nearest", inline: "nearest" });
}));
