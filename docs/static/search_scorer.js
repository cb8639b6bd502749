// Order of what the search finds: pages first, then names of the Python interface.
var Scorer = {
  objNameMatch: 11, objPartialMatch: 6, objPrio: { 0: 15, 1: 5, 2: -5 }, objPrioDefault: 0,
  title: 15, partialTitle: 7, term: 5, partialTerm: 2,
  // [page, title, anchor, description, score, file, kind]
  score: (found) => (found[6] === "object" ? found[4] - 100 : found[4]),
};
