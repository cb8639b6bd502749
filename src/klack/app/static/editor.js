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
