// Order of the results of the site's search: pages for users first, records of changes and measurements last.
var Scorer = {
  score: ([page, , , , score]) => {
    const bonus = [
      ["tutorials/", 4], ["how-to/", 4], ["reference/api", 0], ["reference/", 3], ["index", 3],
      ["atlas/", -4], ["studies/", -4], ["changelog", -4], ["glossary", -4], ["contributing", -4], ["style", -4],
      ["explanation/choices", -4], ["explanation/architecture", -4], ["explanation/floors", -4],
    ].find(([start]) => page.startsWith(start));
    return score + (bonus ? bonus[1] : 0);
  },
  // The other values are the defaults of Sphinx.
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
