// Which page answers what people type: how to do a thing first, then what it is; why it is so, and what it was, last.
const TOPICS = {
  "start": "install installation pip python version first begin beginner quick tutorial",
  "auto_examples/lorenz": "lorenz homoclinic orbit",
  "auto_examples/pendulum": "pendulum resonance",
  "auto_examples/impact_oscillator": "impact oscillator grazing",
  "auto_examples/stick_slip": "stick slip friction",
  "coming-from": "auto matcont bifurcationkit coco matlab julia migrate",
  "measurement": "measurement measured laboratory experiment units si newton hertz metre noise data fit",
  "how-to/damped-ring": "damping damped threshold",
  "how-to/own-lattice": "own graph network stiffness matrix mass custom lattice",
  "how-to/figures": "plot zones figure draw picture colour label legend publication paper journal matplotlib heat map pdf svg notebook jupyter",
  "files": "save load branch branches results file disk netcdf export csv pandas dataframe xarray table data resume checkpoint matlab",
  "many": "parallel run cores processes multiprocessing cluster dask grid parameters scan workers",
  "studies": "study toml interrupted resume batch",
  "explorer": "explorer web browser interactive gui click slider",
  "command-line": "command line shell terminal json csv option exit status",
  "switching": "switch switching pitchfork period doubling arms bifurcating branches asymmetric",
  "shooting": "shooting floquet multipliers period",
  "lattices": "lattice finite ring chain open grid spring length sites",
  "simulation": "simulate simulation random initial state time integrate run basin lyapunov noise",
  "certified": "certified proof interval rigorous",
  "your-own-problem": "equations problem own hopf fold events tolerance step size jacobian equilibrium sparse no convergence",
  "maps": "map maps henon fixed point",
  "cycles": "limit cycle periodic orbit vector field ode forced hybrid sliding filippov mesh collocation",
  "conservative": "conservative conserved energy hamiltonian backbone family nonlinear normal mode nnm krein integral momentum",
  "extending": "event forcing extend",
  "theory": "theory formula equation units parameters model",
  "comparison": "compare comparison speed fast",
  "glossary": "glossary words meaning abbreviation",
  "limits": "limits limitation missing",
  "citing": "cite citing reference bibtex"
};
const LAST = [
  [/^(changelog|decisions|architecture|contributing)/, -60],
  [/^(limits|comparison|index|api|what-the-paper|figure2)/, -15],
  [/^generated\//, -10]
];

// Stems of the words of a text, as the index has them.
const stems = text => {
  const stemmer = new Stemmer();
  return text.toLowerCase().split(/[^\p{L}\p{N}_]+/u).filter(Boolean).map(word => stemmer.stemWord(word));
};

var Scorer = {
  score: ([page, , , , score]) => {
    const wanted = new Set(stems(new URLSearchParams(location.search).get("q") ?? ""));
    const answered = stems(TOPICS[page] ?? "").filter(word => wanted.has(word)).length;
    const last = LAST.find(([pages]) => pages.test(page));
    return score + 10 * answered + (last ? last[1] : 0);
  },
  // all else as Sphinx has it
  objNameMatch: 11, objPartialMatch: 6, objPrio: {0: 15, 1: 5, 2: -5}, objPrioDefault: 0,
  title: 15, partialTitle: 7, term: 5, partialTerm: 2
};
