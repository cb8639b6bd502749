// Parallel axes: one line per point on a canvas. Dragging on an axis keeps the lines that pass there;
// a click on its name gives the lines its colours.
const VIRIDIS = [[68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141],
                 [39, 173, 129], [92, 200, 99], [170, 220, 50], [253, 231, 37]];
function viridis(share) {
  const at = Math.min(Math.max(share, 0), 1) * (VIRIDIS.length - 1), low = Math.floor(at);
  const [one, other] = [VIRIDIS[low], VIRIDIS[Math.min(low + 1, VIRIDIS.length - 1)]];
  return `rgb(${one.map((value, k) => Math.round(value + (at - low) * (other[k] - value))).join(",")})`;
}
function drawParallel(place, chart) {
  const bottom = 26, left = 46, height = 460, pixels = window.devicePixelRatio || 1;
  const axes = chart.axes, count = axes[0].values.length, marked = new Map();
  const canvas = document.createElement("canvas"), pen = canvas.getContext("2d");
  pen.font = "bold 12px system-ui, sans-serif";
  const widths = axes.map(axis => pen.measureText(axis.label).width);  // names rise to the right
  const right = Math.min(Math.max(124, 24 + 0.93 * widths[axes.length - 1]), 290);
  const top = Math.min(Math.max(100, 32 + 0.39 * Math.max(...widths)), 160);
  place.style.position = "relative";
  place.append(canvas);
  const told = document.createElement("p");
  told.className = "told";
  place.append(told);
  let width = 0;
  const x = k => left + (width - left - right) * (axes.length > 1 ? k / (axes.length - 1) : 0.5);
  const share = (k, value) => (value - axes[k].low) / (axes[k].high - axes[k].low);
  const y = part => height - bottom - part * (height - top - bottom);
  const number = value => Number(value.toPrecision(4)).toString();
  const stays = i => [...marked].every(([k, [low, high]]) => {
    const part = share(k, axes[k].values[i]);
    return low <= part && part <= high;
  });
  function line(i) {
    pen.beginPath();
    axes.forEach((axis, k) => pen.lineTo(x(k), y(share(k, axis.values[i]))));
    pen.stroke();
  }
  function paint() {
    width = place.clientWidth;
    canvas.width = width * pixels;
    canvas.height = height * pixels;
    canvas.style.cssText = `width:${width}px;height:${height}px;cursor:crosshair;touch-action:none`;
    pen.setTransform(pixels, 0, 0, pixels, 0, 0);
    pen.lineWidth = 1;
    const kept = [], others = [];
    for (let i = 0; i < count; i++) (stays(i) ? kept : others).push(i);
    pen.globalAlpha = 0.35;
    pen.strokeStyle = colour("--line");
    others.forEach(line);
    pen.globalAlpha = kept.length > 400 ? 0.35 : 0.75;
    kept.sort((a, b) => axes[chart.coloured].values[b] - axes[chart.coloured].values[a]);
    for (const i of kept) {
      pen.strokeStyle = viridis(share(chart.coloured, axes[chart.coloured].values[i]));
      line(i);
    }
    pen.globalAlpha = 1;
    pen.font = "12px system-ui, sans-serif";
    axes.forEach((axis, k) => {
      pen.strokeStyle = pen.fillStyle = colour("--ink");
      pen.beginPath();
      pen.moveTo(x(k), y(0));
      pen.lineTo(x(k), y(1));
      pen.stroke();
      const words = axis.words.length ? axis.words.map((word, i) => [share(k, i), word])
        : [0, 0.5, 1].map(part => [part, number(axis.low + part * (axis.high - axis.low))]);
      for (const [part, word] of words) {
        pen.globalAlpha = 0.8;
        pen.fillStyle = colour("--paper");
        pen.fillRect(x(k) + 3, y(part) - 8, pen.measureText(word).width + 4, 15);
        pen.globalAlpha = 1;
        pen.fillStyle = colour("--ink");
        pen.fillText(word, x(k) + 5, y(part) + 4);
      }
      pen.save();
      pen.translate(x(k), top - 12);
      pen.rotate(-0.4);
      pen.font = k === chart.coloured ? "bold 12px system-ui, sans-serif" : pen.font;
      pen.fillText(axis.label, -4, 0);
      pen.restore();
      if (marked.has(k)) {
        const [low, high] = marked.get(k);
        pen.fillStyle = "rgba(11,92,143,0.3)";
        pen.fillRect(x(k) - 7, y(high), 14, y(low) - y(high));
      }
    });
    for (let i = 0; i < 60; i++) {
      pen.fillStyle = viridis(i / 59);
      pen.fillRect(width - 14, y((i + 1) / 60), 10, (height - top - bottom) / 60 + 1);
    }
    told.textContent = marked.size ? `${kept.length} of ${count} points` +
      (kept.length <= 12 ? `: ${kept.map(i => chart.names[i]).sort((a, b) => a - b).join(", ")}` : "") : "";
  }
  let grip = null;
  const part = event => {
    const box = canvas.getBoundingClientRect();
    return Math.min(Math.max((height - bottom - (event.clientY - box.top)) / (height - top - bottom), 0), 1);
  };
  canvas.addEventListener("pointerdown", event => {
    const at = event.clientX - canvas.getBoundingClientRect().left;
    const k = axes.findIndex((_, i) => Math.abs(x(i) - at) < 18);
    if (k < 0) return;
    if (event.clientY - canvas.getBoundingClientRect().top < top - 6) {
      chart.coloured = k;
      paint();
      return;
    }
    grip = [k, part(event)];
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", event => {
    if (!grip) return;
    const [k, from] = grip, to = part(event);
    marked.set(k, [Math.min(from, to), Math.max(from, to)]);
    paint();
  });
  canvas.addEventListener("pointerup", event => {
    if (grip && Math.abs(part(event) - grip[1]) < 0.01) marked.delete(grip[0]);
    grip = null;
    paint();
  });
  window.addEventListener("resize", paint);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint);
  paint();
}
