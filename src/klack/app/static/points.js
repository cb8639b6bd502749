// Points of a study: scatter with its front, parallel axes, table; one selection in all of them.
(() => {
  "use strict";
  const ROWS = 20, EVERY = 1500, NEAR = 14;
  const make = (tag, given = {}, ...inner) => {
    const found = document.createElement(tag);
    for (const [key, value] of Object.entries(given)) {
      if (key === "text") found.textContent = value;
      else if (key.startsWith("on")) found.addEventListener(key.slice(2), value);
      else if (value !== undefined && value !== false) found.setAttribute(key, value === true ? "" : value);
    }
    found.append(...inner);
    return found;
  };
  const colour = name => getComputedStyle(document.body).getPropertyValue(name).trim();
  const digits = (value, count = 4) => {
    if (value === null || value === undefined || Number.isNaN(value)) return "–";
    const size = Math.abs(value);
    const text = size !== 0 && (size < 1e-4 || size >= 1e6) ? value.toExponential(count - 1)
      : Number(value.toPrecision(count)).toString();
    return text.replace("-", "−");
  };
  const spent = seconds => seconds < 100 ? `${Math.round(seconds)} s`
    : seconds < 6000 ? `${Math.round(seconds / 60)} min`
    : `${Math.floor(seconds / 3600)} h ${Math.round(seconds % 3600 / 60)} min`;
  const unit = column => column.unit ? ` [${column.unit}]` : "";
  const plural = (count, word) => `${count} ${word}${count === 1 ? "" : "s"}`;

  class Points {
    constructor(root) {
      this.root = root;
      this.path = root.dataset.path;
      this.mark = "";
      this.brushes = new Map();      // name of a column: [lowest, highest]
      this.hidden = false;
      this.sorted = { name: "", down: false };
      this.page = 0;
      this.chosen = null;
      this.hasAxes = false;          // chosen by hand
      this.frontOnly = false;
      this.nearFront = false;
      this.frames = new Set();
      this.parts = Object.fromEntries(["status", "scatter", "chosen", "parallel", "table", "rest"]
        .map(name => [name, document.getElementById(`kp-${name}`)]));
      this.build();
      new ResizeObserver(() => this.draw(true)).observe(this.parts.scatter);
      new MutationObserver(() => this.draw(true))
        .observe(document.body, { attributes: true, attributeFilter: ["class"] });
      this.follow();
    }

    // ------------------------------------------------------------------ what comes

    async follow() {
      for (;;) {
        if (!document.body.contains(this.root)) return;
        let wait = EVERY;
        try {
          const query = new URLSearchParams({ path: this.path, known: this.mark });
          const answer = await fetch(`/points-data?${query}`);
          if (answer.ok) wait = this.take(await answer.json());
        } catch { this.tell("The server does not answer; the study itself continues.", "fair"); }
        await new Promise(done => setTimeout(done, wait));
      }
    }

    take(told) {
      if (told.error) { this.tell(told.error, "out"); return 5 * EVERY; }
      this.job = told.job;
      this.live = told.live;
      if (told.study) {
        this.mark = told.mark;
        this.takeStudy(told.study);
      }
      this.showStatus();
      return told.job && told.job.state === "running" ? EVERY : 3 * EVERY;
    }

    takeStudy(study) {
      const first = !this.study;
      this.study = study;
      for (const column of study.columns) {
        column.numbers = Float64Array.from(column.values, value => value === null ? NaN : value);
        column.finite = column.numbers.filter(Number.isFinite);
        let low = Infinity, high = -Infinity;
        for (const value of column.finite) { if (value < low) low = value; if (value > high) high = value; }
        column.low = low; column.high = high;
      }
      this.place = new Map(study.points.map((point, k) => [point, k]));
      this.front = new Set(study.front.map(point => this.place.get(point)).filter(k => k !== undefined));
      this.order = study.front.map(point => this.place.get(point)).filter(k => k !== undefined);
      this.missed = new Set(study.missed);
      this.lost = new Set(study.lost);
      this.reasons = new Map(study.failures.points);
      this.doubt = new Map(study.doubt);
      this.shown = study.columns.filter(column => column.varies
        && (column.role === "parameter" || column.role === "measure")).slice(0, 24);
      const measures = study.columns.filter(column => column.role === "measure" && column.finite.length);
      const goals = measures.filter(column => column.way);
      const pick = [...goals, ...measures, ...study.columns];
      const known = name => study.columns.some(column => column.name === name);
      // measures come after the first points: the axes are theirs unless somebody works with the others
      const free = first || !(this.hasAxes || this.brushes.size);
      if (free || !known(this.x)) this.x = (pick[0] || {}).name;
      if (free || !known(this.y)) this.y = (pick.find(column => column.name !== this.x) || pick[0] || {}).name;
      for (const name of [...this.brushes.keys()]) if (!known(name)) this.brushes.delete(name);
      this.offerAxes();
      this.select();
      this.showRest();
      this.showChosen();
      this.root.dataset.points = study.points.length;
    }

    column(name) { return this.study.columns.find(column => column.name === name); }

    select() {
      const count = this.study.points.length;
      const brushes = [...this.brushes].map(([name, range]) => [this.column(name).numbers, range]);
      this.selected = new Uint8Array(count);
      let chosen = 0;
      for (let k = 0; k < count; k++) {
        let inside = 1;
        for (const [numbers, [low, high]] of brushes) {
          const value = numbers[k];
          if (!(value >= low && value <= high)) { inside = 0; break; }
        }
        this.selected[k] = inside;
        chosen += inside;
      }
      this.count = chosen;
      this.draw();
    }

    brush(name, range) {
      if (range) this.brushes.set(name, range); else this.brushes.delete(name);
      this.page = 0;
      this.select();
    }

    choose(k) {
      if (k === undefined || k === null) return;
      this.chosen = this.study.points[k];
      this.showChosen();
      this.draw();
      this.parts.scatter.dispatchEvent(new CustomEvent("kchoose", { detail: this.chosen }));
    }

    step(by) {
      if (!this.order.length) return;
      const at = this.order.indexOf(this.place.get(this.chosen));
      const next = at < 0 ? (by > 0 ? 0 : this.order.length - 1)
        : Math.min(Math.max(at + by, 0), this.order.length - 1);
      this.choose(this.order[next]);
    }

    // ------------------------------------------------------------------ what is made once

    build() {
      const { status, scatter, parallel, table } = this.parts;
      this.badge = make("span", { class: "k-badge", role: "status" });
      this.badge.textContent = "reading …";
      this.bar = make("i");
      this.progress = make("div", { class: "k-bar", role: "progressbar", "aria-label": "points computed", hidden: true }, this.bar);
      this.figures = make("div", { class: "k-figures" });
      this.best = make("p", { class: "k-note" });
      status.append(this.badge, this.progress, this.best, this.figures);

      this.across = make("select", { class: "k-input", id: "kp-x", onchange: event => { this.x = event.target.value; this.hasAxes = true; this.draw(true); } });
      this.up = make("select", { class: "k-input", id: "kp-y", onchange: event => { this.y = event.target.value; this.hasAxes = true; this.draw(true); } });
      this.chart = make("canvas", { tabindex: 0, role: "img", id: "kp-chart" });
      this.under = make("p", { class: "k-soft kp-under" });
      const near = make("input", { type: "checkbox", onchange: event => { this.nearFront = event.target.checked; this.draw(true); } });
      scatter.append(
        make("div", { class: "kp-axes" },
          make("label", {}, make("span", { class: "k-soft", text: "Across" }), this.across),
          make("label", {}, make("span", { class: "k-soft", text: "Up" }), this.up)),
        this.chart, this.under,
        this.legend(),
        make("div", { class: "kp-tools" },
          make("button", { type: "button", class: "k-btn", text: "Previous on the front", onclick: () => this.step(-1) }),
          make("button", { type: "button", class: "k-btn", text: "Next on the front", onclick: () => this.step(1) }),
          make("label", { class: "k-btn" }, near, " near the front only")));
      this.listen(this.chart, false);
      this.chart.addEventListener("keydown", event => {
        const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
        if (by) { event.preventDefault(); this.step(by); }
      });

      this.told = make("span", { class: "k-soft", role: "status", id: "kp-told" });
      this.lines = make("canvas", { role: "img", id: "kp-lines" });
      this.ranges = make("div", { class: "kp-ranges" });
      parallel.append(
        make("div", { class: "k-head" }, make("h2", { text: "All parameters and measures" }), this.told,
          make("button", { type: "button", class: "k-btn", text: "Clear the selection",
            onclick: () => { this.brushes.clear(); this.page = 0; this.select(); this.showRanges(); } })),
        make("p", { class: "k-soft", text: "Drag along an axis, or across the chart above: only the points within that range stay in all views. Click an axis to remove its range." }),
        make("div", { class: "k-scroll", tabindex: "0" }, this.lines),
        make("details", { ontoggle: () => this.showRanges() }, make("summary", { text: "Ranges as numbers" }), this.ranges));
      this.listenLines();

      this.rows = make("div", { class: "k-scroll", tabindex: "0" });
      this.pages = make("div", { class: "kp-tools" });
      const only = make("input", { type: "checkbox", onchange: event => { this.frontOnly = event.target.checked; this.page = 0; this.showTable(); } });
      table.append(
        make("div", { class: "k-head" }, make("h2", { text: "Points" }), make("label", { class: "k-btn" }, only, " front only")),
        this.rows, this.pages);
    }

    legend() {
      const sign = (kind, words) => make("span", {}, make("i", { class: `kp-sign ${kind}`, "aria-hidden": true }), words);
      return make("div", { class: "kp-legend k-soft" },
        sign("front", "front"), sign("plain", "dominated"), sign("missed", "misses a bound"),
        sign("doubt", "in doubt"), sign("picked", "selected"), sign("best", "recommended"), sign("today", "today's case"));
    }

    offerAxes() {
      for (const [box, name] of [[this.across, this.x], [this.up, this.y]]) {
        const offered = this.study.columns.filter(column => column.finite.length);
        const now = [...box.options].map(option => option.value).join("\n");
        if (now !== offered.map(column => column.name).join("\n")) {
          box.replaceChildren(...offered.map(column => make("option", {
            value: column.name, text: `${column.label}${unit(column)}${column.way ? `, ${column.way}` : ""}` })));
        }
        box.value = name;
      }
    }

    // ------------------------------------------------------------------ status

    tell(words, grade) {
      this.badge.className = `k-badge ${grade || ""}`;
      if (this.badge.textContent !== words) this.badge.textContent = words;
    }

    showStatus() {
      const job = this.job, study = this.study;
      const running = job && job.state === "running";
      if (running) {
        const parts = [job.command === "optimise" ? "search runs" : "study runs"];
        if (job.done !== null) parts.push(`${job.done} of ${job.command === "optimise" ? "at most " : ""}${job.most}`);
        else parts.push(job.stage);
        if (job.left !== null && job.left > 0) parts.push(`about ${spent(job.left)} left`);
        this.tell(parts.join(", "), "");
      } else if (this.live) {
        const words = { cancelled: "stopped", lost: "ended without a result or a message", failed: "failed" };
        this.tell(`${words[job.state] || job.state}; the points so far are kept`, job.state === "failed" ? "out" : "fair");
      } else {
        this.tell(study && !study.feasible ? "complete; no point meets all bounds" : "complete", study && !study.feasible ? "fair" : "good");
      }
      this.progress.hidden = !running;
      const share = running ? Math.round(100 * (job.done !== null && job.most ? job.done / job.most : job.fraction)) : 0;
      this.progress.setAttribute("aria-valuenow", share);
      this.bar.style.width = `${share}%`;
      this.best.textContent = running ? job.best.replace(/^best/, "Best") : (job && this.live && job.told) || "";
      if (!study) return;
      const computed = study.count - study.failed - study.waiting;
      const numbers = [["computed", computed], ["failed", study.failed], ["to do", running ? Math.max(study.waiting, (job.most || 0) - (job.done || 0)) : study.waiting],
        ["in doubt", study.doubtful], ["on the front", study.front.length]];
      this.figures.replaceChildren(...numbers.map(([word, number]) => make("div", { class: "k-figure" },
        make("div", { class: "k-soft", text: word }), make("b", { text: String(number) }))));
    }

    showRest() {
      const { study } = this, { rest } = this.parts, inner = [];
      const open = [...rest.querySelectorAll("details[open]")].map(part => part.dataset.of);
      const details = (of, title, ...content) => make("details", { "data-of": of, open: open.includes(of), class: "k-sheet k-pad" },
        make("summary", { text: title }), ...content);
      if (study.points.length < study.count) {
        inner.push(make("p", { class: "k-error", text:
          `${study.points.length} of ${study.count} points are shown: all of the front, and others evenly. klack export --to csv writes all of them.` }));
      }
      if (study.failed) {
        const listed = study.failures.points;
        inner.push(details("failed", `${plural(study.failed, "point")} without measures`,
          make("ul", {}, ...study.failures.reasons.map(([reason, times]) => make("li", { text: `${times} times: ${reason}` }))),
          make("details", {}, make("summary", { text: listed.length < study.failed ? `The first ${listed.length}` : "Each point" }),
            make("ul", {}, ...listed.map(([point, reason]) => make("li", { text: `Point ${point}: ${reason}` }))))));
      }
      if (study.bounds.length) inner.push(make("p", { class: "k-note", text: `Bounds: ${study.bounds.join("; ")}.` }));
      if (study.warnings.length) inner.push(details("notes", plural(study.warnings.length, "note"), ...study.warnings.map(text => make("p", { class: "k-note", text }))));
      inner.push(make("p", { class: "k-note", text: `${study.title}: ${study.design}. Computed by klack ${study.version}, ${study.created.slice(0, 16).replace("T", " ")}.` }));
      rest.replaceChildren(...inner);
    }

    // ------------------------------------------------------------------ one point

    marks(k) {
      const words = [];
      if (this.lost.has(k)) words.push("no measures");
      if (this.front.has(k)) words.push("on the front");
      if (this.study.points[k] === this.study.best) words.push("recommended");
      if (this.missed.has(k)) words.push("misses a bound");
      if (this.doubt.has(k)) words.push("in doubt");
      return words;
    }

    change(column, value) {
      const today = column.today;
      if (column.words.length || value === null || today === null || Number.isNaN(value)) return "–";
      const by = value - today, sign = by < 0 ? "−" : "+", size = Math.abs(by);
      if (column.level) return `${sign}${size.toFixed(1)} ${column.unit}`;
      const share = today ? `${sign}${(100 * size / Math.abs(today)).toFixed(2)} %` : "";
      if (column.time) return `${sign}${digits(size, 3)} ${column.unit}${share ? `, ${share}` : ""}`;
      return share || `${sign}${digits(size, 3)} ${column.unit}`;
    }

    text(column, value) {
      if (value === null || Number.isNaN(value)) return "–";
      return column.words.length ? String(column.words[value]) : column.level ? value.toFixed(1).replace("-", "−") : digits(value);
    }

    showChosen() {
      const { chosen } = this.parts, k = this.place.get(this.chosen);
      if (k === undefined) {
        chosen.replaceChildren(make("p", { class: "k-soft", text: "Click a point, or a number in the table: its values next to today's, its click, its case file." }));
        return;
      }
      const rows = this.study.columns.map(column => make("tr", {},
        make("td", { text: `${column.label}${unit(column)}`, title: column.name }),
        make("td", { text: this.text(column, column.today) }),
        make("td", { text: this.text(column, column.values[k]) }),
        make("td", { text: this.change(column, column.values[k]) })));
      const doubt = this.doubt.get(k), reason = this.reasons.get(this.chosen);
      chosen.replaceChildren(
        make("h2", { text: `Point ${this.chosen}` }),
        make("p", { class: "k-soft", text: this.marks(k).join(", ") || "dominated by a point of the front, or without objectives" }),
        ...(reason ? [make("p", { class: "k-error", text: reason })] : []),
        ...(doubt === undefined ? [] : [make("p", { class: "k-error", text: this.study.doubts[doubt] })]),
        make("div", { class: "k-scroll", tabindex: "0" }, make("table", { class: "k-table kp-compare" },
          make("thead", {}, make("tr", {}, ...["", "case", `point ${this.chosen}`, "difference"].map(text => make("th", { scope: "col", text })))),
          make("tbody", {}, ...rows))));
    }

    // ------------------------------------------------------------------ table

    listed() {
      const found = [];
      for (let k = 0; k < this.selected.length; k++) {
        if (this.selected[k] && (!this.frontOnly || this.front.has(k))) found.push(k);
      }
      const { name, down } = this.sorted, column = name && this.column(name);
      if (!column) return found;
      const size = k => column.numbers[k];
      return found.sort((a, b) => {
        const one = size(a), other = size(b);
        if (Number.isNaN(one) || Number.isNaN(other)) return Number.isNaN(one) - Number.isNaN(other);
        return down ? other - one : one - other;
      });
    }

    showTable() {
      const all = this.listed(), last = Math.max(Math.ceil(all.length / ROWS) - 1, 0);
      this.page = Math.min(this.page, last);
      const rows = all.slice(this.page * ROWS, (this.page + 1) * ROWS);
      const sort = name => { this.sorted = { name, down: this.sorted.name === name && !this.sorted.down }; this.page = 0; this.showTable(); };
      const head = (name, text, title) => make("th", { scope: "col", "aria-sort": this.sorted.name !== name || !name ? undefined : this.sorted.down ? "descending" : "ascending" },
        make("button", { type: "button", class: "kp-sort", text: `${text}${this.sorted.name === name && name ? (this.sorted.down ? " ↓" : " ↑") : ""}`, title, onclick: () => sort(name) }));
      const focused = document.activeElement && document.activeElement.dataset && document.activeElement.dataset.point;
      this.rows.replaceChildren(make("table", { class: "k-table kp-table" },
        make("thead", {}, make("tr", {}, head("", "point", "in the order of the study"), ...this.shown.map(column => head(column.name, `${column.label}${unit(column)}`, column.name)), make("th", { scope: "col", text: "marks" }))),
        make("tbody", {}, ...rows.map(k => make("tr", { class: this.study.points[k] === this.chosen ? "chosen" : this.front.has(k) ? "front" : "" },
          make("td", {}, make("button", { type: "button", class: "kp-point", "data-point": this.study.points[k], text: String(this.study.points[k]), "aria-label": `point ${this.study.points[k]}`, onclick: () => this.choose(k) })),
          ...this.shown.map(column => make("td", { text: this.text(column, column.values[k]) })),
          make("td", { text: this.marks(k).join(", ") }))))));
      if (focused) { const again = this.rows.querySelector(`[data-point="${CSS.escape(focused)}"]`); if (again) again.focus({ preventScroll: true }); }
      const go = (text, page) => make("button", { type: "button", class: "k-btn", text, disabled: page < 0 || page > last, onclick: () => { this.page = page; this.showTable(); } });
      this.pages.replaceChildren(go("First", this.page ? 0 : -1), go("Back", this.page - 1),
        make("span", { class: "k-soft", text: `page ${this.page + 1} of ${last + 1}, ${plural(all.length, "point")}` }),
        go("Next", this.page + 1), go("Last", this.page < last ? last : last + 1));
    }

    showRanges() {
      if (!this.study || !this.ranges.parentElement.open) return;
      this.ranges.replaceChildren(...this.shown.filter(column => !column.words.length).map(column => {
        const range = this.brushes.get(column.name) || [];
        const entry = (place, word) => make("input", { class: "k-input", type: "text", inputmode: "decimal", value: range[place] === undefined || !Number.isFinite(range[place]) ? "" : digits(range[place], 5),
          placeholder: digits(place ? column.high : column.low), "aria-label": `${column.label}, ${word}`,
          onchange: event => {
            const text = event.target.value.trim().replace("−", "-").replace(",", "."), now = [...(this.brushes.get(column.name) || [-Infinity, Infinity])];
            const value = text === "" ? (place ? Infinity : -Infinity) : Number(text);
            if (Number.isNaN(value)) { event.target.setAttribute("aria-invalid", "true"); return; }
            now[place] = value;
            this.brush(column.name, Number.isFinite(now[0]) || Number.isFinite(now[1]) ? now : null);
          } });
        return make("div", { class: "kp-range" }, make("span", { text: `${column.label}${unit(column)}`, title: column.name }), entry(0, "at least"), entry(1, "at most"));
      }));
    }

    // ------------------------------------------------------------------ drawing

    draw(whole = false) {
      if (!this.study) return;
      this.whole = this.whole || whole || this.drawn !== this.study;
      if (this.pending) return;
      this.pending = true;
      requestAnimationFrame(() => {
        const begin = performance.now();
        this.pending = false;
        this.drawScatter();
        this.drawLines(this.whole);
        this.drawn = this.study;
        this.whole = false;
        const some = this.brushes.size > 0;
        const words = some ? `${this.count} of ${this.study.points.length} selected` : `${plural(this.study.points.length, "point")}`;
        if (this.told.textContent !== words) this.told.textContent = words;
        clearTimeout(this.later);
        this.later = setTimeout(() => { this.showTable(); this.showRanges(); }, 80);
        this.root.dataset.took = (performance.now() - begin).toFixed(1);
      });
    }

    paper(canvas, width, height) {
      const pixels = window.devicePixelRatio || 1;
      if (canvas.width !== Math.round(width * pixels) || canvas.height !== Math.round(height * pixels)) {
        canvas.width = Math.round(width * pixels);
        canvas.height = Math.round(height * pixels);
        canvas.style.width = `${width}px`;
        canvas.style.height = `${height}px`;
      }
      const pen = canvas.getContext("2d");
      pen.setTransform(pixels, 0, 0, pixels, 0, 0);
      pen.clearRect(0, 0, width, height);
      pen.font = "12.5px system-ui, sans-serif";
      return pen;
    }

    extent(column) {
      let low = column.low, high = column.high;
      if (this.nearFront && this.order.length) {
        const own = [...this.order.map(k => column.numbers[k]), column.today === null ? NaN : column.today].filter(Number.isFinite);
        low = Math.min(...own.slice(0, 5000)); high = Math.max(...own.slice(0, 5000));
      } else if (column.today !== null) { low = Math.min(low, column.today); high = Math.max(high, column.today); }
      if (!(high > low)) { const about = Math.abs(low) || 1; low -= 0.05 * about; high += 0.05 * about; }
      const room = (this.nearFront ? 0.15 : 0.05) * (high - low);
      return [low - room, high + room];
    }

    ticks(column, low, high, most) {
      if (column.words.length) return column.words.map((_, k) => k).filter(k => k >= low && k <= high).slice(0, 12);
      const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
      const step = [1, 2, 5, 10].map(k => k * power).find(k => k >= rough) || rough;
      const found = [];
      for (let value = Math.ceil(low / step) * step; value <= high + 1e-9 * step && found.length < 20; value += step) found.push(Math.abs(value) < 1e-9 * step ? 0 : value);
      return found;
    }

    drawScatter() {
      const width = Math.max(this.parts.scatter.clientWidth - 28, 240), height = Math.min(Math.max(0.62 * width, 260), 440);
      const pen = this.paper(this.chart, width, height);
      const across = this.column(this.x), up = this.column(this.y);
      if (!across || !up) return;
      const left = 58, right = 12, top = 12, bottom = 44;
      const [x0, x1] = this.extent(across), [y0, y1] = this.extent(up);
      const x = value => left + (value - x0) / (x1 - x0) * (width - left - right);
      const y = value => height - bottom - (value - y0) / (y1 - y0) * (height - top - bottom);
      this.map = { x, y, left, right, top, bottom, width, height,
        atX: pixel => x0 + (pixel - left) / (width - left - right) * (x1 - x0),
        atY: pixel => y0 + (height - bottom - pixel) / (height - top - bottom) * (y1 - y0) };
      const ink = colour("--ink"), soft = colour("--soft"), grid = colour("--grid"), accent = colour("--accent"), picked = colour("--picked"), fair = colour("--fair"), sheet = colour("--sheet"), ghost = colour("--ghost");
      pen.lineWidth = 1;
      pen.fillStyle = soft;
      pen.textAlign = "center";
      pen.textBaseline = "top";
      const label = (column, value) => column.words.length ? String(column.words[value]).slice(0, 12) : digits(value);
      for (const value of this.ticks(across, x0, x1, width / 90)) {
        pen.strokeStyle = grid;
        pen.beginPath(); pen.moveTo(x(value), top); pen.lineTo(x(value), height - bottom); pen.stroke();
        pen.fillText(label(across, value), x(value), height - bottom + 6);
      }
      pen.textAlign = "right";
      pen.textBaseline = "middle";
      for (const value of this.ticks(up, y0, y1, height / 55)) {
        pen.strokeStyle = grid;
        pen.beginPath(); pen.moveTo(left, y(value)); pen.lineTo(width - right, y(value)); pen.stroke();
        pen.fillText(label(up, value), left - 6, y(value));
      }
      pen.fillStyle = ink;
      pen.textAlign = "center";
      pen.textBaseline = "bottom";
      const title = (column, space) => this.fitted(pen, `${column.label}${unit(column)}${column.way ? `, ${column.way}` : ""}`, space);
      pen.fillText(title(across, width - left - right), (left + width - right) / 2, height - 6);
      pen.save();
      pen.translate(12, (top + height - bottom) / 2);
      pen.rotate(-Math.PI / 2);
      pen.fillText(title(up, height - top - bottom), 0, 4);
      pen.restore();
      pen.save();
      pen.beginPath(); pen.rect(left - 8, top - 8, width - left - right + 16, height - top - bottom + 16); pen.clip();
      const some = this.brushes.size > 0, xs = across.numbers, ys = up.numbers, full = 2 * Math.PI;
      // batches of one style each: a path per point would take seconds for thousands
      const batch = (test, style, alpha, size, paint) => {
        let held = 0;
        pen.globalAlpha = alpha;
        pen.fillStyle = pen.strokeStyle = style;
        pen.beginPath();
        for (let k = 0; k < xs.length; k++) {
          if (!test(k) || this.front.has(k)) continue;
          const px = x(xs[k]), py = y(ys[k]);
          if (!(px > -50 && px < width + 50 && py > -50 && py < height + 50)) continue;
          pen.moveTo(px + size, py);
          pen.arc(px, py, size, 0, full);
          if (++held % 64 === 0) { pen[paint](); pen.beginPath(); }
        }
        pen[paint]();
      };
      const square = (px, py) => pen.strokeRect(px - 4.5, py - 4.5, 9, 9);
      const plain = k => !this.missed.has(k);
      pen.lineWidth = 1.1;
      batch(k => plain(k) && !(some && this.selected[k]), ghost, some ? 0.3 : 0.6, 3, "fill");
      batch(k => !plain(k) && !(some && this.selected[k]), ghost, some ? 0.3 : 0.7, 2.8, "stroke");
      if (some) {
        batch(k => plain(k) && this.selected[k], picked, 0.85, 3, "fill");
        batch(k => !plain(k) && this.selected[k], picked, 0.85, 2.8, "stroke");
      }
      pen.globalAlpha = 1;
      if (across.way && up.way) {
        const line = [...this.order].filter(k => Number.isFinite(xs[k]) && Number.isFinite(ys[k])).sort((a, b) => xs[a] - xs[b]);
        const flat = this.study.columns.filter(column => column.way).length <= 2;
        if (flat) {
          pen.strokeStyle = accent; pen.lineWidth = 1.8;
          pen.beginPath();
          line.forEach((k, n) => n ? pen.lineTo(x(xs[k]), y(ys[k])) : pen.moveTo(x(xs[k]), y(ys[k])));
          pen.stroke();
        }
      }
      for (const k of this.order) {
        if (!Number.isFinite(xs[k]) || !Number.isFinite(ys[k])) continue;
        const px = x(xs[k]), py = y(ys[k]), size = 5.5;
        pen.globalAlpha = some && !this.selected[k] ? 0.35 : 1;
        pen.beginPath(); pen.moveTo(px, py - size); pen.lineTo(px + size, py); pen.lineTo(px, py + size); pen.lineTo(px - size, py); pen.closePath();
        pen.fillStyle = accent; pen.fill();
        pen.strokeStyle = sheet; pen.lineWidth = 1; pen.stroke();
      }
      pen.globalAlpha = 1;
      pen.strokeStyle = fair; pen.lineWidth = 1.6;
      for (const k of this.doubt.keys()) {
        if (Number.isFinite(xs[k]) && Number.isFinite(ys[k])) square(x(xs[k]), y(ys[k]));
      }
      const best = this.place.get(this.study.best);
      if (best !== undefined && Number.isFinite(xs[best]) && Number.isFinite(ys[best])) {
        pen.strokeStyle = ink; pen.lineWidth = 1.6;
        pen.beginPath(); pen.arc(x(xs[best]), y(ys[best]), 10, 0, full); pen.stroke();
      }
      if (across.today !== null && up.today !== null) {
        const px = x(across.today), py = y(up.today);
        for (const [style, wide] of [[sheet, 6], [ink, 3]]) {
          pen.strokeStyle = style; pen.lineWidth = wide;
          pen.beginPath(); pen.moveTo(px - 8, py); pen.lineTo(px + 8, py); pen.moveTo(px, py - 8); pen.lineTo(px, py + 8); pen.stroke();
        }
      }
      const chosen = this.place.get(this.chosen);
      if (chosen !== undefined && Number.isFinite(xs[chosen]) && Number.isFinite(ys[chosen])) {
        const px = x(xs[chosen]), py = y(ys[chosen]);
        pen.strokeStyle = ink; pen.lineWidth = 1;
        pen.setLineDash([3, 3]);
        pen.beginPath(); pen.moveTo(px, top); pen.lineTo(px, height - bottom); pen.moveTo(left, py); pen.lineTo(width - right, py); pen.stroke();
        pen.setLineDash([]);
        pen.lineWidth = 2.4;
        pen.beginPath(); pen.arc(px, py, 7.5, 0, full); pen.stroke();
      }
      pen.restore();
      if (this.frame) {
        const [a, b, c, d] = this.frame;
        pen.strokeStyle = picked; pen.lineWidth = 1.4;
        pen.strokeRect(Math.min(a, c), Math.min(b, d), Math.abs(c - a), Math.abs(d - b));
      }
      const words = `${up.label} over ${across.label}: ${plural(xs.length, "point")}, ${this.order.length} on the front. Left and right arrow keys go along the front.`;
      if (this.chart.getAttribute("aria-label") !== words) this.chart.setAttribute("aria-label", words);
    }

    nearest(px, py) {
      const xs = this.column(this.x).numbers, ys = this.column(this.y).numbers;
      let best = null, least = NEAR * NEAR;
      for (let k = 0; k < xs.length; k++) {
        const far = (this.map.x(xs[k]) - px) ** 2 + (this.map.y(ys[k]) - py) ** 2;
        const counted = this.front.has(k) ? 0.6 * far : far;
        if (counted < least) { least = counted; best = k; }
      }
      return best;
    }

    listen(canvas) {
      const at = event => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
      let from = null;
      canvas.addEventListener("pointerdown", event => {
        if (!this.map || event.button) return;
        from = at(event);
        canvas.setPointerCapture(event.pointerId);
      });
      canvas.addEventListener("pointermove", event => {
        if (!this.map) return;
        const [px, py] = at(event);
        if (from && Math.hypot(px - from[0], py - from[1]) > 5) {
          this.frame = [from[0], from[1], px, py];
          this.frameBrush();
        } else if (!from) {
          const k = this.nearest(px, py);
          this.under.textContent = k === null ? "" : `Point ${this.study.points[k]}: ${[this.x, this.y].map(name => { const column = this.column(name); return `${column.label} ${this.text(column, column.values[k])} ${column.unit}`; }).join(", ")}`;
        }
      });
      canvas.addEventListener("pointerup", event => {
        if (!from || !this.map) return;
        const [px, py] = at(event);
        const framed = this.frame;
        from = this.frame = null;
        this.dragged = false;
        if (framed) { this.draw(); return; }
        const k = this.nearest(px, py);
        if (k === null) { this.brushes.delete(this.x); this.brushes.delete(this.y); this.select(); this.showRanges(); }
        else this.choose(k);
      });
      canvas.addEventListener("pointercancel", () => { from = this.frame = null; this.dragged = false; this.draw(); });
    }

    frameBrush() {
      this.dragged = true;
      const [a, b, c, d] = this.frame;
      const xs = [this.map.atX(a), this.map.atX(c)].sort((p, q) => p - q), ys = [this.map.atY(b), this.map.atY(d)].sort((p, q) => p - q);
      this.brushes.set(this.x, xs);
      this.brushes.set(this.y, ys);
      this.page = 0;
      this.select();
    }

    // ------------------------------------------------------------------ parallel axes

    linesMap() {
      const room = Math.max(this.parts.parallel.clientWidth - 34, 240), axes = this.shown.length || 1;
      const width = Math.max(room, 84 * axes + 40), height = 330, top = 62, bottom = 26, side = Math.min(64, width / (2 * axes));
      const x = k => axes > 1 ? side + k * (width - 2 * side) / (axes - 1) : width / 2;
      const ends = this.shown.map(column => column.high > column.low ? [column.low, column.high] : [column.low - 1, column.high + 1]);
      const y = (k, value) => height - bottom - (value - ends[k][0]) / (ends[k][1] - ends[k][0]) * (height - top - bottom);
      const at = (k, pixel) => ends[k][0] + (height - bottom - pixel) / (height - top - bottom) * (ends[k][1] - ends[k][0]);
      return { width, height, top, bottom, x, y, at, ends };
    }

    drawLines(whole) {
      if (!this.shown.length) return;
      const map = this.axes = this.linesMap(), { width, height, top, bottom, x, y } = map;
      const columns = this.shown, count = this.study.points.length, some = this.brushes.size > 0;
      const complete = this.complete = whole || !this.complete || this.complete.length !== count ? Uint8Array.from({ length: count }, (_, k) => columns.every(column => Number.isFinite(column.numbers[k])) ? 1 : 0) : this.complete;
      const line = (pen, k) => {
        for (let n = 0; n < columns.length; n++) {
          const py = y(n, columns[n].numbers[k]);
          if (n) pen.lineTo(x(n), py); else pen.moveTo(x(0), py);
        }
      };
      // strokes of 32 lines each: a stroke per line, or one of all of them, takes several times as long
      const strokes = (pen, test) => {
        let held = 0;
        pen.beginPath();
        for (let k = 0; k < count; k++) {
          if (!complete[k] || !test(k)) continue;
          line(pen, k);
          if (++held % 32 === 0) { pen.stroke(); pen.beginPath(); }
        }
        pen.stroke();
      };
      const dense = of => Math.min(Math.max(220 / (of + 1), 0.07), 0.6);
      if (whole || !this.ground || this.ground.width !== Math.round(width * (window.devicePixelRatio || 1))) {
        this.ground = this.ground || document.createElement("canvas");
        const pen = this.paper(this.ground, width, height);
        pen.globalAlpha = dense(count);
        pen.lineWidth = 1;
        pen.strokeStyle = colour("--ghost");
        strokes(pen, k => !this.front.has(k));
      }
      const pen = this.paper(this.lines, width, height);
      pen.globalAlpha = some ? 0.35 : 1;
      pen.drawImage(this.ground, 0, 0, width, height);
      pen.lineWidth = 1;
      if (some) {
        pen.strokeStyle = colour("--picked");
        pen.globalAlpha = dense(this.count) + 0.06;
        // while a range is dragged some of the lines do: all of them follow at its end
        const every = this.dragged ? Math.ceil(this.count / 800) : 1;
        let met = 0;
        strokes(pen, k => this.selected[k] && !this.front.has(k) && met++ % every === 0);
      }
      pen.lineWidth = 1.8;
      pen.globalAlpha = 0.95;
      pen.strokeStyle = colour("--accent");
      strokes(pen, k => this.front.has(k) && (!some || this.selected[k]));
      const ink = colour("--ink"), soft = colour("--soft"), sheet = colour("--sheet");
      const chosen = this.place.get(this.chosen);
      if (chosen !== undefined && complete[chosen]) {
        pen.strokeStyle = ink; pen.lineWidth = 2.6; pen.globalAlpha = 1;
        pen.beginPath(); line(pen, chosen); pen.stroke();
      }
      if (columns.every(column => column.today !== null)) {
        pen.strokeStyle = ink; pen.lineWidth = 2; pen.globalAlpha = 1; pen.setLineDash([6, 4]);
        pen.beginPath();
        columns.forEach((column, n) => { const py = Math.min(Math.max(y(n, column.today), top - 6), height - bottom + 6); if (n) pen.lineTo(x(n), py); else pen.moveTo(x(0), py); });
        pen.stroke(); pen.setLineDash([]);
      }
      pen.globalAlpha = 1;
      columns.forEach((column, n) => {
        pen.strokeStyle = ink; pen.lineWidth = 1;
        pen.beginPath(); pen.moveTo(x(n), top); pen.lineTo(x(n), height - bottom); pen.stroke();
        pen.textAlign = "center"; pen.textBaseline = "alphabetic";
        pen.fillStyle = ink;
        const space = Math.min(columns.length > 1 ? (x(1) - x(0)) - 8 : width, 2 * Math.min(x(n), width - x(n)) - 4);
        this.wrapped(pen, `${column.label}${unit(column)}`, space).forEach((text, row) => pen.fillText(text, x(n), 14 + 14 * row));
        pen.fillStyle = soft;
        const [low, high] = map.ends[n];
        const word = value => column.words.length ? String(column.words[Math.round(value)]).slice(0, 12) : digits(value, 3);
        const written = [[word(high), top - 5], [word(low), height - bottom + 16]];
        for (const [text, py] of written) {
          const wide = pen.measureText(text).width;
          pen.fillText(text, Math.min(Math.max(x(n), wide / 2 + 2), width - wide / 2 - 2), py);
        }
        const range = this.brushes.get(column.name);
        if (range) {
          const from = Math.max(y(n, Math.min(range[1], high)), top), to = Math.min(y(n, Math.max(range[0], low)), height - bottom);
          pen.fillStyle = colour("--picked"); pen.globalAlpha = 0.35;
          pen.fillRect(x(n) - 8, Math.min(from, to), 16, Math.max(Math.abs(to - from), 2));
          pen.globalAlpha = 1; pen.strokeStyle = colour("--picked"); pen.lineWidth = 1.5;
          pen.strokeRect(x(n) - 8, Math.min(from, to), 16, Math.max(Math.abs(to - from), 2));
        }
      });
      const words = `Parallel axes: ${columns.map(column => column.label).join(", ")}. ${this.count} of ${count} points selected. The ranges can be given as numbers below.`;
      if (this.lines.getAttribute("aria-label") !== words) this.lines.setAttribute("aria-label", words);
    }

    wrapped(pen, text, space) {
      const rows = [];
      for (const word of text.split(" ")) {
        const longer = rows.length ? `${rows[rows.length - 1]} ${word}` : word;
        if (rows.length && pen.measureText(longer).width <= space) rows[rows.length - 1] = longer;
        else rows.push(word);
      }
      return (rows.length > 3 ? [...rows.slice(0, 2), `${rows[2]}…`] : rows).map(row => this.fitted(pen, row, space));
    }

    fitted(pen, text, space) {
      let short = text.length > 200 ? `${text.slice(0, 200)}…` : text;
      while (short.length > 2 && pen.measureText(short).width > space) short = `${short.slice(0, -2)}…`;
      return short;
    }

    listenLines() {
      const canvas = this.lines;
      const at = event => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
      let from = null;
      const axis = px => {
        let best = null, least = 26;
        this.shown.forEach((_, n) => { const far = Math.abs(this.axes.x(n) - px); if (far < least) { least = far; best = n; } });
        return best;
      };
      canvas.addEventListener("pointerdown", event => {
        if (!this.axes || event.button) return;
        const [px, py] = at(event), n = axis(px);
        if (n === null) return;
        from = [n, py, false];
        canvas.setPointerCapture(event.pointerId);
        event.preventDefault();
      });
      canvas.addEventListener("pointermove", event => {
        if (!this.axes) return;
        const [px, py] = at(event);
        canvas.style.cursor = axis(px) === null ? "default" : "ns-resize";
        if (!from) return;
        if (Math.abs(py - from[1]) > 4) from[2] = true;
        if (from[2]) {
          this.dragged = true;
          const range = [this.axes.at(from[0], from[1]), this.axes.at(from[0], py)].sort((p, q) => p - q);
          this.brush(this.shown[from[0]].name, range);
        }
      });
      const end = () => {
        this.dragged = false;
        if (from && from[2]) this.draw();
        if (from && !from[2]) { this.brush(this.shown[from[0]].name, null); this.showRanges(); }
        from = null;
      };
      canvas.addEventListener("pointerup", end);
      canvas.addEventListener("pointercancel", () => { from = null; this.dragged = false; this.draw(); });
    }
  }

  const wait = setInterval(() => {
    const root = document.getElementById("kp-root");
    if (root && document.getElementById("kp-rest")) { clearInterval(wait); window.klackPoints = new Points(root); }
  }, 40);
})();
