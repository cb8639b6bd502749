// Rules of layout that every page keeps; each returns sentences about what breaks it.
window.klackRules = (() => {
  const TOUCH = 24, CONTRAST = 4.5, SLACK = 1.5;
  const name = (e) => {
    const own = e.closest("[id]");
    const classes = typeof e.className === "string" ? e.className : e.className.baseVal;
    return `<${e.tagName.toLowerCase()}${classes ? "." + classes.trim().split(/\s+/).join(".") : ""}>` +
      (own ? ` in #${own.id}` : "");
  };
  const seen = (e) => e.checkVisibility({ opacityProperty: true, visibilityProperty: true });
  const colour = (text) => {
    const found = text.match(/^rgba?\(([\d.]+),\s*([\d.]+),\s*([\d.]+)(?:,\s*([\d.]+))?\)$/);
    if (found) return [+found[1], +found[2], +found[3], found[4] === undefined ? 1 : +found[4]];
    const mixed = text.match(/^color\(srgb ([\d.]+) ([\d.]+) ([\d.]+)(?: \/ ([\d.]+))?\)$/);
    return mixed ? [...mixed.slice(1, 4).map((v) => 255 * v), mixed[4] === undefined ? 1 : +mixed[4]] : [0, 0, 0, 0];
  };
  const over = (top, under) => [0, 1, 2].map((i) => top[3] * top[i] + (1 - top[3]) * under[i]);
  const opacity = (e) => { let o = 1; for (let p = e; p; p = p.parentElement) o *= +getComputedStyle(p).opacity; return o; };
  // what is painted behind an element, from the page upwards
  const ground = (e) => {
    const layers = [];
    for (let p = e; p; p = p.parentElement) {
      const layer = colour(getComputedStyle(p).backgroundColor);
      if (layer[3] > 0) layers.push(layer);
      if (layer[3] === 1) break;
    }
    const dark = getComputedStyle(document.documentElement).colorScheme.includes("dark") &&
      matchMedia("(prefers-color-scheme: dark)").matches;
    let found = dark ? [18, 18, 18] : [255, 255, 255];
    for (const layer of layers.reverse()) found = over(layer, found);
    return found;
  };
  const light = (c) => {
    const [r, g, b] = c.map((v) => v / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const ratio = (a, b) => { const [x, y] = [light(a), light(b)].sort((p, q) => q - p); return (x + 0.05) / (y + 0.05); };

  // the part of a rectangle that the scrolled and clipping boxes around it leave
  const clipped = (rect, e) => {
    let { left, top, right, bottom } = rect;
    for (let p = e; p && p !== document.body; p = p.parentElement) {
      const style = getComputedStyle(p);
      if (style.overflowX !== "visible" || style.overflowY !== "visible") {
        const box = p.getBoundingClientRect();
        [left, right] = [Math.max(left, box.left), Math.min(right, box.right)];
        [top, bottom] = [Math.max(top, box.top), Math.min(bottom, box.bottom)];
      }
      if (style.position === "fixed") break;
    }
    return right - left > 1 && bottom - top > 1 ? { left, top, right, bottom } : null;
  };
  const readers = (e) => e.closest(".k-sr, .k-skip, .sr-only, [aria-live].q-notifications") !== null;

  // every line of text that is seen: its element, its rectangle, its words
  const texts = () => {
    const found = [];
    const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    while (walker.nextNode()) {
      const node = walker.currentNode, e = node.parentElement;
      if (!node.data.trim() || ["SCRIPT", "STYLE", "NOSCRIPT", "OPTION", "TEXTAREA"].includes(e.tagName)) continue;
      if (!seen(e) || readers(e)) continue;
      if (e instanceof SVGElement) {
        const outer = e.closest("text");
        if (outer && outer.firstChild && walker.currentNode === firstText(outer)) {
          found.push({ e: outer, rect: outer.getBoundingClientRect(), words: outer.textContent });
        }
        continue;
      }
      const range = document.createRange();
      range.selectNodeContents(node);
      for (const rect of range.getClientRects()) {
        if (rect.width > 0.5 && rect.height > 0.5) found.push({ e, rect, words: node.data.trim().slice(0, 40) });
      }
    }
    return found;
  };
  const firstText = (e) => document.createTreeWalker(e, NodeFilter.SHOW_TEXT).nextNode();

  const sideways = () => {
    const root = document.documentElement, over = root.scrollWidth - root.clientWidth;
    const said = over > 0 ? [`the page is ${over} px wider than the window of ${root.clientWidth} px`] : [];
    for (const e of document.querySelectorAll("body *")) {
      if (!/auto|scroll/.test(getComputedStyle(e).overflowX) || e.scrollWidth <= e.clientWidth + 1 || !seen(e)) continue;
      if (e.tabIndex < 0 && e.tagName !== "PRE" && !e.querySelector(":scope > [contenteditable=true]")) said.push(`${name(e)} is scrolled sideways, and the Tab key does not reach it`);
    }
    return said;
  };

  const isScrolled = (e) => {
    for (let p = e.closest("svg"); p && p !== document.body; p = p.parentElement) {
      if (/auto|scroll/.test(getComputedStyle(p).overflowX) && p.scrollWidth > p.clientWidth) return true;
    }
    return false;
  };
  const outside = () => {
    const said = [], width = document.documentElement.clientWidth;
    for (const { e, rect, words } of texts()) {
      let box = null, scrolls = false;
      for (let p = e instanceof SVGElement ? e.closest("svg") : e; p && p !== document.body; p = p.parentElement) {
        const style = getComputedStyle(p);
        if (/auto|scroll/.test(style.overflowX)) scrolls = true;
        const drawn = colour(style.backgroundColor)[3] > 0 || (style.borderLeftStyle !== "none" && parseFloat(style.borderLeftWidth) > 0);
        const clips = /hidden|clip/.test(style.overflowX);
        if (style.display === "inline" && !drawn) continue;
        if (clips && style.textOverflow === "ellipsis" && (p.title || p.getAttribute("aria-label"))) { box = null; scrolls = true; break; }
        if (drawn || clips || scrolls || p instanceof SVGElement) { box = p; break; }
      }
      if (scrolls) continue;
      if (box) {
        const b = box.getBoundingClientRect();
        if (rect.left < b.left - SLACK || rect.right > b.right + SLACK || rect.top < b.top - 4 || rect.bottom > b.bottom + 4) {
          said.push(`"${words}" ${name(e)} leaves its box ${name(box)}`);
        }
      }
      if (e instanceof SVGElement && isScrolled(e)) continue;  // a drawing that is wider than its place
      if (rect.right > width + SLACK || rect.left < -SLACK) said.push(`"${words}" ${name(e)} leaves the window`);
    }
    return said;
  };

  const overlapping = () => {
    const said = [], found = [];
    for (const text of texts()) {
      if (text.e.closest("header, dialog, .q-notification, [popover]")) continue;
      const rect = clipped(text.rect, text.e);
      if (rect) found.push({ ...text, rect });
    }
    found.sort((a, b) => a.rect.top - b.rect.top);
    for (let i = 0; i < found.length; i++) {
      for (let j = i + 1; j < found.length; j++) {
        const [a, b] = [found[i], found[j]];
        if (b.rect.top > a.rect.bottom) break;
        if (a.e.closest("[role=dialog]") !== b.e.closest("[role=dialog]")) continue; // one lies over the other
        const wide = Math.min(a.rect.right, b.rect.right) - Math.max(a.rect.left, b.rect.left);
        const high = Math.min(a.rect.bottom, b.rect.bottom) - Math.max(a.rect.top, b.rect.top);
        const part = (r) => Math.min(r.bottom - r.top, r.right - r.left);
        // the rectangle of a line is higher than its letters: a quarter of it is air
        if (wide > 2 && high > 0.3 * Math.min(part(a.rect), part(b.rect)) && high > 3) {
          said.push(`"${a.words}" ${name(a.e)} and "${b.words}" ${name(b.e)} overlap by ${wide.toFixed(0)} x ${high.toFixed(0)} px`);
        }
      }
    }
    return said;
  };

  const contrast = () => {
    const said = new Set();
    const judge = (e, ink, words) => {
      if (ink[3] === 0) return;
      const back = ground(e), mixed = over([ink[0], ink[1], ink[2], ink[3] * opacity(e)], back);
      const style = getComputedStyle(e), found = ratio(mixed, back);
      const large = parseFloat(style.fontSize) >= 24 || (parseFloat(style.fontSize) >= 18.66 && +style.fontWeight >= 700);
      if (found < (large ? 3 : CONTRAST) - 0.005) said.add(`"${words}" ${name(e)} has a contrast of ${found.toFixed(2)}`);
    };
    for (const { e, words } of texts()) {
      if (e.closest("[disabled], [aria-disabled=true]")) continue;
      const style = getComputedStyle(e), inner = e.querySelector("tspan");
      judge(e instanceof SVGElement ? e.closest("svg").parentElement : e,
        colour(e instanceof SVGElement ? getComputedStyle(inner || e).fill : style.color), words);
    }
    for (const e of document.querySelectorAll("input, select, textarea")) {
      if (!seen(e) || e.disabled || ["checkbox", "radio", "range", "color"].includes(e.type)) continue;
      const empty = !e.value && e.placeholder;
      judge(e, colour(getComputedStyle(e, empty ? "::placeholder" : null).color), e.value || e.placeholder || name(e));
    }
    return [...said];
  };

  const CONTROLS = "a[href], button, input:not([type=hidden]), select, textarea, summary, [role=button], [tabindex]:not([tabindex='-1'])";
  const controls = () => [...document.querySelectorAll(CONTROLS)].filter((e) => seen(e) && !e.disabled && !readers(e) && !(e instanceof SVGElement));
  const touch = () => {
    const said = [];
    for (const e of controls()) {
      let { width, height } = e.getBoundingClientRect();
      const label = e.closest("label") || (e.id && document.querySelector(`label[for="${CSS.escape(e.id)}"]`));
      if (label && ["checkbox", "radio"].includes(e.type)) ({ width, height } = label.getBoundingClientRect());
      const line = getComputedStyle(e).display === "inline" && e.closest("p, li, dd, td, small, figcaption");
      const alone = line && line.textContent.trim() === e.textContent.trim();
      if (line && !alone) continue; // a link within a sentence
      if (width < TOUCH - 0.5 || height < TOUCH - 0.5) {
        said.push(`${name(e)} "${(e.textContent || e.getAttribute("aria-label") || "").trim().slice(0, 30)}" is ${width.toFixed(0)} x ${height.toFixed(0)} px`);
      }
    }
    return said;
  };

  // the element that has the focus: is it marked, and is it seen?
  const focus = () => {
    const e = document.activeElement;
    if (!e || e === document.body) return null;
    const style = getComputedStyle(e.closest(".cm-editor") || e), said = [];  // the frame of an editor shows it
    const marked = (s) => (s.outlineStyle !== "none" && parseFloat(s.outlineWidth) >= 1 && ratio(over(colour(s.outlineColor), ground(e.parentElement || e)), ground(e.parentElement || e)) >= 3) || s.outlineStyle === "auto";
    if (!marked(style)) said.push(`${name(e)} has the focus and does not show it`);
    const box = e.getBoundingClientRect();
    const within = clipped(box, e.parentElement);
    if (!within || within.bottom < 0 || within.top > innerHeight || within.right < 0 || within.left > innerWidth) {
      said.push(`${name(e)} has the focus and is out of sight`);
    } else {
      const [x, y] = [(Math.max(0, within.left) + Math.min(innerWidth, within.right)) / 2, (Math.max(0, within.top) + Math.min(innerHeight, within.bottom)) / 2];
      const there = document.elementFromPoint(x, y);
      const own = there && (e.contains(there) || there.contains(e) || (e.labels && [...e.labels].some((l) => l.contains(there))));
      if (!own) said.push(`${name(e)} has the focus and lies behind ${there ? name(there) : "nothing"}`);
    }
    return { key: (window.klackKeys ??= new Map()).has(e) ? window.klackKeys.get(e) : (window.klackKeys.set(e, window.klackKeys.size), window.klackKeys.size - 1), said };
  };

  return { sideways, outside, overlapping, contrast, touch, focus, controls: () => controls().length };
})();
