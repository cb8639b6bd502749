// The page of a report: charts in the colours of the page, parts that fold, commands to copy.
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const narrow = window.matchMedia("(max-width: 639px)");
const colour = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// Labels of bars take half of a narrow screen: there they stand above their bars.
function narrowed(figure) {
  const layout = figure.layout;
  const listed = figure.data.filter(trace => trace.showlegend !== false).length;  // one below the other
  Object.assign(layout, {font: {...layout.font, size: 11}, margin: {l: 52, r: 8, t: 8, b: 44},
    height: layout.height + 18 * Math.max(0, listed - 2)});
  if (!figure.data.some(trace => trace.orientation === "h")) return;
  const rows = figure.data[0].y;
  layout.margin.l = 8;
  layout.height = 130 + 60 * rows.length;
  layout.bargap = 0.64;
  layout.yaxis = {...layout.yaxis, showticklabels: false, ticks: ""};
  layout.annotations = [...(layout.annotations || []), ...rows.map(row => (
    {text: row, x: 0, xref: "paper", xanchor: "left", y: row, yanchor: "bottom", yshift: 13, showarrow: false}))];
}
// Colours of the page, so that a chart is readable in the dark as well.
function themed(figure, paper) {
  const [ink, grid, zero, line] = [paper ? "#22262b" : colour("--ink"), paper ? "#e3e6ea" : colour("--grid"),
    paper ? "#b7bcc4" : colour("--zero"), paper ? "#5b626b" : colour("--soft")];
  const back = paper ? "#ffffff" : colour("--paper"), band = paper ? "#dbe9f6" : colour("--band");
  const {layout} = figure;
  Object.assign(layout, {paper_bgcolor: back, plot_bgcolor: back, font: {...layout.font, color: ink},
    hoverlabel: {...layout.hoverlabel, bgcolor: back, font: {color: ink}}});
  for (const name of Object.keys(layout).filter(key => /^[xy]axis/.test(key))) {
    Object.assign(layout[name], {gridcolor: grid, zerolinecolor: zero, linecolor: ink});
  }
  if (layout.polar) {
    Object.assign(layout.polar, {bgcolor: back});
    for (const axis of [layout.polar.angularaxis, layout.polar.radialaxis]) {
      Object.assign(axis, {gridcolor: grid, linecolor: ink});
    }
  }
  for (const mark of layout.annotations || []) {
    mark.font = {...mark.font, color: ink};
    if (mark.bgcolor) mark.bgcolor = back + "bf";
  }
  for (const shape of layout.shapes || []) {
    if (shape.type === "rect") shape.fillcolor = band;
    else shape.line.color = line;
  }
  for (const trace of figure.data) {
    for (const part of [trace.line, trace.marker]) {
      if (part && (part.color === "#111111" || part.black)) Object.assign(part, {color: ink, black: true});
    }
  }
  return figure;
}
const drawn = [];
function draw() {
  drawn.length = 0;
  for (const plot of document.querySelectorAll(".plot")) {
    const figure = JSON.parse(plot.nextElementSibling.textContent);
    if (figure.axes && plot.firstChild) continue;
    if (figure.axes) {  // upright lettering needs its room: scrolled where the window is narrow
      plot.style.minWidth = `${64 * figure.axes.length + 100}px`;
      plot.parentElement.classList.add("drawn");
      drawParallel(plot, figure);
      continue;
    }
    if (narrow.matches) narrowed(figure);
    themed(figure, false);
    const buttons = figure.frames ? ["toImage"] : ["toImage", "zoom2d", "pan2d", "resetScale2d"];
    Plotly.newPlot(plot, {data: figure.data, layout: figure.layout, frames: figure.frames || [],
      config: {responsive: true, displaylogo: false, displayModeBar: !narrow.matches, modeBarButtons: [buttons]}});
    if (!figure.frames) drawn.push([plot, figure]);
  }
  letReach();
}
function repaint(paper) {
  for (const [plot, figure] of drawn) {
    themed(figure, paper);
    Plotly.react(plot, figure.data, figure.layout);
  }
}
dark.addEventListener("change", () => repaint(false));
narrow.addEventListener("change", () => { if (window.Plotly) draw(); });
// what is wider than the window is scrolled, with the keyboard as well
function letReach() {
  for (const box of document.querySelectorAll(".scroll, figure.wide, figure.drawn")) {
    const title = box.closest(".part")?.querySelector("h2") || document.querySelector("h1");
    const given = box.scrollWidth > box.clientWidth
      ? {tabindex: "0", role: "group", "aria-label": `${title.textContent}, wider than the window`} : {};
    for (const name of ["tabindex", "role", "aria-label"]) {
      if (name in given) box.setAttribute(name, given[name]);
      else box.removeAttribute(name);
    }
  }
}
window.addEventListener("resize", letReach);
window.addEventListener("load", letReach);
const parts = [...document.querySelectorAll(".part")];
function unfold(open) { for (const part of parts) part.open = open; }
const fold = document.getElementById("fold");
fold.addEventListener("click", () => {
  const open = parts.some(part => !part.open);
  unfold(open);
  fold.textContent = open ? "Collapse all" : "Expand all";
});
for (const link of document.querySelectorAll(".contents a")) {
  link.addEventListener("click", () => { document.getElementById(link.hash.slice(1)).open = true; });
}
// a chart that was drawn or resized while folded has no width
for (const part of parts) {
  part.addEventListener("toggle", () => {
    if (part.open && window.Plotly) {
      for (const plot of part.querySelectorAll(".plot.js-plotly-plot")) Plotly.Plots.resize(plot);
    }
  });
}
for (const button of document.querySelectorAll(".copy")) {
  button.addEventListener("click", () => {
    navigator.clipboard.writeText(button.previousElementSibling.textContent).then(
      () => { button.textContent = "Copied"; }, () => { button.textContent = "Not allowed here"; });
  });
}
window.addEventListener("beforeprint", () => { unfold(true); if (window.Plotly) repaint(true); });
window.addEventListener("afterprint", () => { if (window.Plotly) repaint(false); });
