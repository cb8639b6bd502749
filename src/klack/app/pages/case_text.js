// The text of a case in CodeMirror: line numbers, colours, folds, search, and one history of what is typed, and of what the form and
// the schematic change. Its part with the letters answers as a text area does (value), and tells what a user changes by the event "typed".
import * as CM from "nicegui-codemirror";

const told = CM.Annotation.define();  // a change that the server made
const mark = CM.StateEffect.define();  // [[line, column, kind] ...] from 1, an error first
const NONE = { lines: CM.RangeSet.empty, numbers: CM.RangeSet.empty, first: null, isWrong: false };

class MarkedNumber extends CM.GutterMarker {
  constructor(kind) {
    super();
    this.elementClass = kind;
  }
}
const marked = (doc, places) => {
  const known = places.filter(([number]) => number && number <= doc.lines).map(([number, , kind]) => [doc.line(number).from, kind]);
  const set = (made) => CM.RangeSet.of(known.map(([from, kind]) => made(kind).range(from)), true);
  const [[number, column, kind] = []] = places;
  const line = number ? doc.line(Math.min(number, doc.lines)) : null;
  return {
    lines: set((kind) => CM.Decoration.line({ class: kind })),
    numbers: set((kind) => new MarkedNumber(kind)),
    first: line && Math.min(line.from + Math.max(column - 1, 0), line.to),
    isWrong: kind === "k-wrong",
  };
};
const marks = CM.StateField.define({
  create: () => NONE,
  update(now, { changes, docChanged, effects, state }) {
    const found = effects.find((effect) => effect.is(mark));
    if (found) return marked(state.doc, found.value);
    if (!docChanged) return now;
    const { lines, numbers, first } = now;  // they move with their lines
    return { ...now, lines: lines.map(changes), numbers: numbers.map(changes), first: first && changes.mapPos(first) };
  },
  provide: (field) => [
    CM.EditorView.decorations.from(field, ({ lines }) => lines),
    CM.gutterLineClass.from(field, ({ numbers }) => numbers),
    CM.EditorView.contentAttributes.from(field, ({ isWrong }) => ({ "aria-invalid": `${isWrong}` })),
  ],
});

export default {
  template: '<div class="k-yaml-box"></div>',
  props: { text: String, attributes: Object },
  mounted() {
    const colours = new CM.Compartment();
    const { githubLightInit, githubDarkInit } = CM.themes;
    const settings = {
      background: "transparent", foreground: "var(--ink)", caret: "var(--ink)", gutterBackground: "transparent", gutterForeground: "var(--soft)",
      lineHighlight: "color-mix(in srgb, var(--soft) 9%, transparent)", fontFamily: 'ui-monospace, "SF Mono", Menlo, Consolas, "DejaVu Sans Mono", monospace',
    };
    const theme = () => (document.body.classList.contains("body--dark") ? githubDarkInit : githubLightInit)({ settings });
    const language = new CM.Compartment();
    const view = this.view = new CM.EditorView({
      parent: this.$el,
      doc: this.text,
      extensions: [
        CM.basicSetup, CM.indentUnit.of("  "), language.of([]), colours.of(theme()), marks,
        CM.EditorView.contentAttributes.of(this.attributes),
        CM.EditorView.updateListener.of(({ docChanged, transactions }) => {
          if (docChanged && !transactions.some((change) => change.annotation(told))) {
            view.contentDOM.dispatchEvent(new Event("typed", { bubbles: true }));
          }
        }),
      ],
    });
    CM.languages.find(({ name }) => name === "YAML").load().then((found) => view.dispatch({ effects: language.reconfigure(found) }));
    this.watcher = new MutationObserver(() => view.dispatch({ effects: colours.reconfigure(theme()) }));
    this.watcher.observe(document.body, { attributes: true, attributeFilter: ["class"] });

    const area = view.contentDOM;
    const put = (text, more) => {  // only what differs: the cursor stays, and folds
      const old = view.state.doc.toString(), most = Math.min(old.length, text.length);
      let from = 0, end = 0;
      while (from < most && old[from] === text[from]) from++;
      while (end < most - from && old[old.length - 1 - end] === text[text.length - 1 - end]) end++;
      if (old !== text) view.dispatch({ changes: { from, to: old.length - end, insert: text.slice(from, text.length - end) }, ...more });
    };
    Object.defineProperty(area, "value", { get: () => view.state.doc.toString(), set: put });
    area.told = (text) => put(text, { annotations: [told.of(true), CM.isolateHistory.of("full")] });
    window.klackUndo = () => CM.undo(view);
    window.klackRedo = () => CM.redo(view);
    window.klackMarks = (places, known) => {
      if (area.at > known) return;
      area.heard = known;
      view.dispatch({ effects: mark.of(places) });
    };
    window.klackGo = () => {
      const at = view.state.field(marks).first;
      if (at === null) return;
      view.focus();
      view.dispatch({ selection: { anchor: at }, effects: CM.EditorView.scrollIntoView(at, { y: "center" }) });
      this.$el.scrollIntoView({ block: "nearest" });
    };
  },
  beforeUnmount() {
    this.watcher.disconnect();
    this.view.destroy();
  },
};
