"""Whatever the command line cannot use is one sentence and status 2, and leaves nothing."""

from __future__ import annotations

import re
from pathlib import Path

import networkx as nx
import pytest

from contbreather.cli import BAD_INPUT

from .typed import Run, write_matrix

POINT = "point --a 0.5 --gamma 0.12 --k 0.4"
BRANCH = "branch --free a --gamma 0.1 --k 0.8"
HERE = "point --a 0.6 --gamma 0.05 --k 0.8"
SWITCH = "switch --free a --gamma 0.04 --k 0.8"
DIAGRAM = "diagram --free a --gamma 0.04 --k 0.8"
DAMPED = "simulate --a 0.1 --gamma 0.08 --k 0.8 --damping"
LOST = "simulate --a 0.2 --gamma 0.104 --k 0.8 --damping 0.005"

OF_THE_CHAIN = {
    "gamma at the band's closing": ("point --a 0.5 --gamma 0.25 --k 0.8", r"0 <= gamma < 1/4"),
    "gamma negative": ("point --a 0.5 --gamma -0.1 --k 0.8", r"0 <= gamma < 1/4"),
    "gamma nan": ("point --a 0.5 --gamma nan --k 0.8", r"0 <= gamma < 1/4"),
    "gamma infinite": ("branch --free a --gamma inf --k 0.8", r"0 <= gamma < 1/4"),
    "k above one": ("point --a 0.5 --gamma 0.1 --k 1.0001", r"0 <= k <= 1"),
    "k negative": ("point --a 0.5 --gamma 0.1 --k -0.2", r"0 <= k <= 1"),
    "k nan": ("zones --k nan", r"0 <= k <= 1"),
    "k of zones": ("zones --k 2", r"0 <= k <= 1"),
    "zones at the rim of k": ("zones --k 1", r"zones need 0 < k < 1"),
    "a below the fold": (
        "point --a 0.05 --gamma 0.1 --k 0.8",
        r"below the fold.*the smallest a is 0\.0570290371821",
    ),
    "a infinite": ("point --a inf --gamma 0.1 --k 0.8", r"a = inf: .* finite"),
    "a nan": ("point --a nan --gamma 0.1 --k 0.8", r"a = nan: .* finite"),
    "a zero": ("point --a 0 --gamma 0.1 --k 0.8", r"finite number > 0"),
    "a no number": ("point --a half --gamma 0.1 --k 0.8", r'--a: unable to convert "half"'),
    "a missing": ("point --gamma 0.1 --k 0.8", r"--a is missing: the amplitude"),
    "k missing": ("point --gamma 0.1 --a 0.8", r"--k is missing: the restitution"),
    "value missing": (
        "point --a",
        r"--a takes a value, and none was given; see contbreather point --help",
    ),
    "even forcing": (
        f"{POINT} --forcing '-cos(t)+cos(2*t)'",
        r"is not antisymmetric: over a period it has the even harmonic 2",
    ),
    "forcing with a mean": (f"{POINT} --forcing '1-cos(t)'", r"antisymmetric|mean"),
    "wrong period": (f"{POINT} --forcing 'cos(t/2)'", r"antisymmetric|period"),
    "no formula": (f"{POINT} --forcing 'cos(t'", r"is not a formula"),
    "letter without value": (f"{POINT} --forcing '-cos(t)-c*cos(3*t)'", r"needs a value for c"),
    "time by another name": (f"{POINT} --forcing '-cos(x)'", r"needs a value for x; the time is t"),
    "forcing zero": (f"{POINT} --forcing 0", r"the forcing '0' is zero; a breather needs"),
    "forcing zero by its letter": (f"{POINT} --forcing 'c*cos(t)' --set c=0", r"is zero at c = 0;"),
    "a beyond all bounds": (
        "point --a 1e300 --gamma 0.1 --k 0.8",
        r"too large.*no breather is admissible beyond a = 1, where",
    ),
    "gamma of a boundary": (
        "boundary PF --pair k a --gamma 0.3",
        r"^contbreather: gamma = 0\.3: the coupling must",
    ),
    "root that is not there": (
        "point --a 0.5 --gamma 0.1 --k 0.8 --root 3",
        r"root 3: the solutions of \(11\) are 1: p = 0\.767381929, 2: p = 0\.257470095; choose",
    ),
    "root zero of a branch": ("branch --free a --gamma 0.1 --k 0.8 --root 0", r"root = 0: a whole"),
    "root zero": ("point --a 0.5 --gamma 0.1 --k 0.8 --root 0", r"root 0: the solutions"),
    "root of a branch that is not there": (
        "branch --free gamma --a 0.5 --gamma 0.1 --k 0.8 --root 3",
        r"root 3: the solutions",
    ),
    "zones without a curve": (
        "zones --k 0.8 --gamma-window 0.02 0.03 --a-window 0.3 0.4",
        r"no curve passes the window",
    ),
    "value without letter": (f"{POINT} --set c=1", r"unknown forcing parameter c"),
    "set without a number": (f"{POINT} --set c=lots", r"NAME=VALUE was expected"),
    "set without a name": (f"{POINT} --set =1", r"NAME=VALUE was expected"),
    "no sites": (f"{POINT} --sites 0", r"sites = .*: a whole number, at least 1"),
    "sites no number": (f"{POINT} --sites many", r"many is not a whole number"),
    "threshold alone": (f"{POINT} --threshold 1.005", r"--threshold needs --sites"),
    "threshold alone on a branch": (f"{BRANCH} --threshold 1.01", r"--threshold needs --sites"),
    "threshold alone on a line": (
        "boundary LP --k 0.8 --threshold 1.01",
        r"--threshold needs --sites",
    ),
    "threshold alone in a plane": ("zones --k 0.8 --threshold 1.01", r"--threshold needs --sites"),
    "threshold below one": (f"{POINT} --sites 10 --threshold 0.9", r"threshold = 0\.9"),
    "threshold nan": (f"{POINT} --sites 10 --threshold nan", r"threshold = nan"),
    "unknown option": (f"{POINT} --amplitude 3", r"Unknown option.*--amplitude"),
    "unknown command": (
        "zone",
        r'Unknown command "zone"\. Did you mean "zones"\?; see contbreather --help',
    ),
    "stray word": (f"{POINT} more", r"more"),
    "no free parameter": ("branch --gamma 0.1 --k 0.8", r"--free is missing"),
    "unknown free parameter": (
        "branch --free b --gamma 0.1 --k 0.8",
        r"unknown parameter 'b'; there are a, gamma, k",
    ),
    "unknown direction": (f"{BRANCH} --towards left", r'"both", "up", "down"'),
    "window above existence": (
        f"{BRANCH} --window 0.9 0.95 --root 1",
        r"no breather .* between 0\.9 and 0\.95: .*\(15\) is broken",
    ),
    "window below existence": (f"{BRANCH} --window 0.01 0.05", r"no breather .* below the fold"),
    "window the wrong way round": (f"{BRANCH} --window 0.9 0.5", r"the smaller first"),
    "window nan": (f"{BRANCH} --window nan 0.5", r"two finite numbers"),
    "window infinite": (f"{BRANCH} --window 0 inf", r"two finite numbers"),
    "half a window": (f"{BRANCH} --window 0.5", r"--window takes 2 values, .* and 1 was given"),
    "window outside of the domain": (
        "branch --free gamma --a 0.5 --k 0.8 --window 0.3 0.4",
        r"contains no breather",
    ),
    "start outside of the window": (f"{BRANCH} --a 0.7 --window 0.1 0.6", r"outside of the window"),
    "start that is no breather": (f"{BRANCH} --a 0.95 --root 1", r"\(15\) is broken"),
    "zones in an empty window": ("zones --gamma-window 0.3 0.4", r"contains no breather"),
    "zones above existence": (
        "zones --k 0.8 --gamma-window 0.2 0.24 --a-window 0.9 0.99",
        r"no breather",
    ),
    "zones where nothing can be": (
        "zones --a 2",
        r"no breather at a = 2 for k between 0\.01 and 0\.999 and gamma between 0 and 0\.2499;",
    ),
    "two fixed parameters": ("zones --k 0.8 --a 0.5", r"leave one"),
    "unknown kind": ("boundary HB --k 0.8", r"'HB' is not one of them"),
    "threshold of arms": (
        "boundary PD --k 0.9 --gamma 0.1 --sites 9 --threshold 1.1",
        r"judged by the paper's 1\.005; leave it out",
    ),
    "no kind": ("boundary --k 0.8", r"LP, PF, PD, NS or GR; none was given"),
    "pair of one": ("boundary PF --pair a a --k 0.8", r"two different parameters"),
    "unknown pair": ("boundary PF --pair a b --k 0.8", r"unknown parameter 'b'"),
    "half a pair": ("boundary PF --pair a", r"--pair takes 2 values, .* and 1 was given"),
    "boundary not in the window": (
        "boundary PF --k 0.8 --window 0.1 0.2",
        r"no PF found for gamma between 0\.1 and 0\.2",
    ),
    "seed outside of the window": (
        "boundary PF --k 0.8 --gamma 0.2 --window 0 0.1",
        r"outside of the window",
    ),
    "no such figure": ("figure 9", r"there are the figures 2, 3, 4, 5, 6, 7, 8"),
    "no figure": ("figure", r"there are the figures 2, 3, 4, 5, 6, 7, 8"),
    "empty table name": (f"{BRANCH} --csv ''", r"name of the file to write is empty"),
    "table in a directory's place": (f"{BRANCH} --csv .", r"it is a directory"),
    "figure in a directory's place": ("zones -o .", r"it is a directory"),
    "table nowhere": (f"{BRANCH} --csv nowhere/b.csv", r"there is no directory nowhere"),
    "unknown format": ("zones -o zones.jpeg", r"suffix must be one of"),
    "one file for two": (f"{BRANCH} --csv b.png -o b.png", r"different names"),
    "unwritable": (f"{BRANCH} --csv /proc/b.csv", r"cannot write /proc/b\.csv"),
}
OF_LATTICES = {
    "no such lattice": (f"{HERE} --lattice cube:3", r"--lattice cube:3: expected ring:20, open"),
    "no size": (f"{HERE} --lattice ring", r"--lattice ring: expected ring:20"),
    "size zero": (f"{HERE} --lattice open:0", r"--lattice open:0: expected"),
    "size negative": (f"{HERE} --lattice open:-3", r"--lattice open:-3: expected"),
    "size no number": (f"{HERE} --lattice grid:5xfive", r"--lattice grid:5xfive: expected"),
    "half a grid": (f"{HERE} --lattice grid:5", r"--lattice grid:5: expected"),
    "unknown ends": (f"{HERE} --lattice open:9:loose", r"--lattice open:9:loose: expected"),
    "ring with ends": (f"{HERE} --lattice ring:9:fixed", r"--lattice ring:9:fixed: expected"),
    "lattice and sites": (f"{HERE} --lattice ring:9 --sites 9", r"give one of the two"),
    "no such file": (f"{HERE} --lattice nowhere.csv", r"cannot read nowhere\.csv: No such file"),
    "no such graph": (f"{HERE} --lattice no.graphml", r"cannot read no\.graphml: No such file"),
    "folder": (f"{HERE} --lattice folder.csv", r"cannot read folder\.csv: it is a directory"),
    "words": (f"{HERE} --lattice words.csv", r"no stiffness matrix in words\.csv: could not conv"),
    "bytes": (f"{HERE} --lattice bytes.csv", r"cannot read bytes\.csv: it is not text"),
    "empty": (f"{HERE} --lattice empty.csv", r"no stiffness matrix in empty\.csv: 0 rows of no"),
    "ragged": (f"{HERE} --lattice ragged.csv", r"2 rows of 1, 2 numbers; a square matrix"),
    "not square": (f"{HERE} --lattice wide.csv", r"2 rows of 3 numbers; a square matrix"),
    "not symmetric": (
        f"{HERE} --lattice lopsided.csv",
        r"stiffness\[0, 1\] = -1 but stiffness\[1, 0\] = -0\.5: .* must be symmetric",
    ),
    "not semidefinite": (
        f"{HERE} --lattice falling.csv",
        r"the stiffness matrix has the eigenvalue -1: it must be positive semidefinite",
    ),
    "not finite": (f"{HERE} --lattice nan.csv", r"stiffness\[0, 0\] = nan is not finite"),
    "no graph": (f"{HERE} --lattice broken.graphml", r"no graph in broken\.graphml: "),
    "graph of another language": (f"{HERE} --lattice page.graphml", r"no graph in page\.graphml"),
    "graph with directions": (f"{HERE} --lattice arrows.graphml", r"an undirected networkx graph"),
    "weights in words": (f"{HERE} --lattice stiff.graphml", r"weights 'weight' of the edges must"),
    "negative weight": (f"{HERE} --lattice push.graphml", r"must be positive semidefinite"),
    "negative mass": (f"{HERE} --lattice heavy.graphml", r"masses\[1\] = -2: every mass must be"),
    "mass in words": (f"{HERE} --lattice lead.graphml", r"one number for each site is expected"),
    "site alone": (
        f"{HERE} --lattice apart.graphml --site 2",
        r"site 2 of this lattice has no bond to any other",
    ),
    "site not there": (f"{HERE} --lattice open:9 --site 9", r"no such site on the open chain"),
    "site not whole": (f"{HERE} --lattice open:9 --site 1.5", r"1\.5 is not a whole number"),
    "walls of a site not there": (
        f"{HERE} --lattice open:9 --walls 12:-1,1",
        r"walls of site 12: there is no such site on the open chain .* sites are 0 to 8",
    ),
    "walls crossed": (f"{HERE} --lattice open:9 --walls 1,-1", r"two numbers low < high"),
    "walls nan": (f"{HERE} --lattice open:9 --walls nan,1", r"two numbers low < high"),
    "half a wall": (f"{HERE} --lattice open:9 --walls 1", r"--walls 1: LOW,HIGH is expected"),
    "walls in words": (
        f"{HERE} --lattice open:9 --walls=up,1",
        r"--walls up,1: LOW,HIGH is expected",
    ),
    "walls of no site": (f"{HERE} --lattice open:9 --walls x:-1,1", r"SITE:LOW,HIGH is expected"),
    "walls twice": (f"{HERE} --lattice open:9 --walls -1,1 --walls -2,2", r"one pair for all"),
    "walls of a site twice": (
        f"{HERE} --lattice open:9 --walls 1:-1,1 --walls 1:-2,2",
        r"one pair for all sites, one for each of them",
    ),
    "one wall": (f"{HERE} --lattice open:9 --walls none,1", r"the walls are not symmetric"),
    "damping negative": (
        f"{HERE} --lattice open:9 --damping -1",
        r"damping = -1\.0: .* 0 <= dam",
    ),
    "damping negative beside a ring": (
        f"{HERE} --sites 10 --damping -1",
        r"damping = -1\.0: .* 0 <= dam",
    ),
    "damping nan": (f"{HERE} --lattice open:9 --damping nan", r"damping = nan: .* 0 <= dam"),
    "spring negative": (
        f"{HERE} --lattice open:9 --spring -0.1",
        r"spring = -0\.1: .* 0 <= spr",
    ),
    "spring in resonance": (
        f"{HERE} --lattice open:9 --spring 1",
        r"frequency 1 is in resonance with the orbit: change gamma or spring",
    ),
    "spring above the drive on the infinite chain": (
        f"{HERE} --spring 1.2",
        r"spring = 1\.2: .* below the drive \(above that take a ring of 40 sites\)",
    ),
    "spring that closes the gap of the infinite chain": (
        f"{HERE} --spring 0.9",
        r"gamma = 0\.05, spring = 0\.9: the band .* must stay below 1",
    ),
    "threshold of the infinite chain": (f"{HERE} --threshold 1.01", r"--threshold needs --sites"),
    "damping of the infinite chain": (f"{HERE} --damping 0.1", r"take a ring or another"),
    "site of the infinite chain": (f"{HERE} --site 3", r"on the infinite chain site 0 impacts"),
    "branch with a site not there": (
        "branch --free a --gamma 0.05 --k 0.8 --lattice open:9 --site 9",
        r"no such site on the open chain",
    ),
    "boundary with walls crossed": (
        "boundary PF --gamma 0.05 --k 0.8 --lattice open:9 --walls 1,-1",
        r"two numbers low < high",
    ),
    "damping to vary on the infinite chain": (
        "branch --free damping --a 0.6 --gamma 0.05 --k 0.8 --window 0.01 0.1",
        r"on the infinite chain",
    ),
    "threshold of arms": (
        "switch --free a --gamma 0.05 --k 0.8 --lattice open:9 --threshold 1.02",
        r"--threshold 1\.02: branches that are switched to are judged by the paper's 1\.005",
    ),
    "threshold of a run": (
        "simulate --a 0.6 --gamma 0.05 --k 0.8 --sites 9 --threshold 1.02",
        r"--threshold: the verdict on a run has none",
    ),
    "run from a site not there": (
        "simulate --a 0.6 --gamma 0.05 --k 0.8 --lattice open:9 --site 9",
        r"no such site on the open chain",
    ),
    "run between walls crossed": (
        "simulate --a 0.6 --gamma 0.05 --k 0.8 --lattice open:9 --walls 1,-1",
        r"two numbers low < high",
    ),
    "smooth walls elsewhere": (
        "simulate --a 0.6 --gamma 0.05 --k 0.8 --walls -2,2 --smooth 6",
        r"--walls goes with rigid walls only: leave out --smooth",
    ),
    "threshold zero": (f"{HERE} --lattice open:9 --threshold 0", r"threshold = 0"),
    "zones with damping": ("zones --damping 0.1", r"zones on the infinite chain are of site 0"),
    "lower zones with damping": (
        "zones --damping 0.1 --sites 6 --past-folds",
        r"past_folds: lower breathers are drawn on the infinite chain, or on a ring",
    ),
    "zones of a site that is not there": ("zones --lattice open:5 --site 5", r"no such site"),
    "figure": (
        "figure 4 --walls -2,2",
        r"--walls is not an option of figure: the figures are those",
    ),
}
OF_SWITCHING = {
    "no free parameter": ("switch --gamma 0.04 --k 0.8", r"--free is missing"),
    "no such point": (f"{SWITCH} --at NS", r"--at NS: there is none.* It has VI1, LP1, PF1, GR1"),
    "none on the arm": (f"{SWITCH} --at PF --at PD", r"asymmetric breather.* It has EP1, GR1"),
    "a fold": (f"{SWITCH} --at LP", r"LP1.*no other branch is known to leave points of kind LP"),
    "an end": (f"{SWITCH} --window 0.5 0.9 --at EP", r"EP1.* is where a branch ends"),
    "not in the window": (f"{SWITCH} --window 0.5 0.7", r"--at PF: there is none"),
    "ring without coupling": (
        "switch --free a --gamma 0 --k 0.8 --sites 20",
        r"do not feel each other .* take sites=1",
    ),
    "no ring": (f"{SWITCH} --sites 0", r"sites = .*: a whole number, at least 1"),
    "start outside of the window": (f"{SWITCH} --a 0.4 --window 0.5 0.9", r"outside of the window"),
    "table nowhere": (f"{SWITCH} --csv nowhere/a.csv", r"there is no directory nowhere"),
    "one file twice": (f"{SWITCH} --csv a.svg --output a.svg", r"--csv and --output both name"),
    "negative depth": (f"{DIAGRAM} --depth -1", r"depth = -1: a whole number, at least 0"),
    "no branches": (f"{DIAGRAM} --most 0", r"most = 0: a whole number, at least 1"),
    "diagram of nothing": ("diagram --gamma 0.04 --k 0.8", r"--free is missing"),
}
OF_RUNS = {
    "no amplitude": ("simulate --gamma 0.1 --k 0.8", r"--a is missing"),
    "coupling": ("simulate --a 0.1 --gamma 0.3 --k 0.8", r"0 <= gamma < 1/4"),
    "no breather": ("simulate --a 0.05 --gamma 0.1 --k 0.8", r"the smallest a is 0\.057"),
    "through a wall": (
        "simulate --a 1.05 --gamma 0.1 --k 0.8",
        r"site 1 reaches .* give a state with --start",
    ),
    "through a wall, one stop": (
        "simulate --a 1.05 --gamma 0.2 --k 0.8",
        r"[^.]; give a state with --start instead\n",
    ),
    "half a site": (f"{LOST} --sites 2.5", r"--sites: 2\.5 is not a whole number"),
    "half a seed": (f"{LOST} --seed 1.9", r"--seed: 1\.9 is not a whole number"),
    "heavy damping": (f"{DAMPED} 1e12", r"damping = 1000000000000\.0: .* <= 1e4"),
    "too long": (f"{LOST} --periods 1e13", r"periods = 10000000000000\.0: a length .* to 1e12"),
    "longer than memory": (
        f"{LOST} --periods 1e11",
        r"the states of 20 sites once in each would be 3\.2e\+04 GB.* 1\.07; .* --stream",
    ),
    "smooth and longer than memory": (f"{LOST} --smooth 6 --periods 1e9", r"shorten it, or keep"),
    "push beyond all doubles": (f"{LOST} --perturb 1e308", r"inf of the state is not finite"),
    "too soft": (
        f"{LOST} --smooth 0.3",
        r"m = 0\.3: the hardness .* 0\.5 <= m .* any real one",
    ),
    "too hard": (f"{LOST} --smooth 1e5", r"m = 100000\.0: the hardness .* 0\.5 <= m <= 1e4"),
    "one place for two": (f"{LOST} --csv a.csv --impacts ./a.csv", r"give different names"),
    "one figure for two": (f"{LOST} --final a.png -o ./a.png", r"give different names"),
    "no sites": (f"{LOST} --sites 0", r"sites = .*: a whole number, at least 1"),
    "negative damping": (f"{DAMPED} -0.01", r"damping = -0\.01: the damping .* 0 <= dam"),
    "negative length": (f"{LOST} --periods -3", r"periods = -3\.0: a length"),
    "length nan": (f"{LOST} --periods nan", r"periods = nan"),
    "stream of a fraction": (f"{LOST} --stream f --periods 2.5", r"whole periods"),
    "stream of nan": (f"{LOST} --stream f --periods nan", r"whole periods"),
    "smooth stream": (f"{LOST} --stream f --smooth 6", r"--stream goes with rigid walls"),
    "smooth impacts": (f"{LOST} --impacts f.csv --smooth 6", r"--impacts goes with rigid walls"),
    "soft": (f"{LOST} --smooth 0", r"m = 0\.0: the hardness"),
    "push": (f"{LOST} --perturb -1", r"--perturb -1: a size"),
    "push through a wall": (f"{LOST} --perturb 5", r"lies outside the walls"),
    "seed": (f"{LOST} --perturb 0.1 --seed -1", r"--seed -1"),
    "no file": (f"{LOST} --start nothing.json", r"cannot read nothing\.json: .*JSON with u, v"),
    "no state": (f"{LOST} --start words.txt", r"no state in words\.txt: JSON with u, v"),
    "half a state": (f"{LOST} --start half.json", r"no state in half\.json"),
    "other length": (f"{LOST} --start two.csv --sites 5", r"has 2 sites; leave out --sites"),
    "outside": (f"{LOST} --start out.csv", r"u\[0\] = 1\.5 lies outside the walls"),
    "one name for two": (f"{LOST} --csv a.csv --impacts a.csv", r"give different names"),
    "figure": (f"{LOST} -o run.jpeg", r"suffix must be one of"),
    "place": (f"{LOST} --final nowhere/f.json", r"there is no directory nowhere"),
}
OF_ATLASES = {
    "no numbers": ("atlas --k 0.8:0.9", r"neither a number nor LOW:HIGH:COUNT"),
    "no values": ("atlas --k 0.8 --over c3", r"NAME=VALUE,VALUE,\.\.\. was expected"),
    "unknown letter": ("atlas --k 0.8 --over c3=1", r"unknown forcing parameter c3"),
    "nothing fixed": ("atlas", r"values of exactly one of k, gamma, a"),
    "nowhere": ("atlas --k 0.8 --save nowhere/a.nc", r"there is no directory"),
    "no workers": ("atlas --k 0.8 --workers 0", r"--workers: 0: at least one process was"),
    "no table": ("atlas --k 0.8 --save a.csv", r"a netCDF-4 file, call it a\.nc"),
    "too many": (
        "atlas --k 0.1:0.9:1000000000",
        r"--k: 1000000000 values from 0\.1 to 0\.9: a whole number from 1 to 100000 was",
    ),
    "too many of a letter": (
        "atlas --k 0.8 --over c=0:1:100000000000",
        r"--over c: 100000000000 values .* 1 to 100000",
    ),
    "too many together": (
        "atlas --k 0.1:0.9:1000 --over c=0:1:101 --forcing 'cos(t)+c*cos(3*t)'",
        r"1000 of k times 101 of c are 101000 combinations: at most 100000",
    ),
    "none": ("atlas --k 0.1:0.9:0", r"--k: 0 values from 0\.1 to 0\.9: a whole number"),
    "less than none": ("atlas --k 0.1:0.9:-3", r"--k: -3 values from 0\.1 to 0\.9"),
    "half a value": ("atlas --k 0.1:0.9:2.5", r"'0\.1:0\.9:2\.5' is neither a number nor"),
    "to infinity": ("atlas --k 0.1:inf:3", r"--k = inf: .* a finite number"),
    "from nan": ("atlas --k nan:0.9:3", r"--k = nan: .* a finite number"),
    "beyond all doubles": ("atlas --a=-1e308:1e308:3", r"--a = -1e\+308: .* a finite number"),
    "one value thrice": ("atlas --k 0.8:0.8:3", r"no 3 different values from 0\.8 to 0\.8"),
    "nothing": ("atlas --k ''", r"--k: '' is neither a number nor LOW:HIGH:COUNT"),
    "a letter twice": (
        "atlas --k 0.8 --over c=0:1:3 --over c=2 --forcing 'cos(t)+c*cos(3*t)'",
        r"--over: c is given twice, \[0\.0, 0\.5, 1\.0\] and \[2\.0\]; leave one",
    ),
    "a letter set and varied": (
        "atlas --k 0.8 --over c=0:1:3 --set c=2 --forcing 'cos(t)+c*cos(3*t)'",
        r"c is given twice",
    ),
    "a letter of another meaning": (
        "atlas --k 0.8 --over lattice=0:1:3 --forcing 'cos(t)+lattice*cos(3*t)'",
        r"--over lattice: this name is taken; rename it in the formula",
    ),
}
OF_PLACES = {
    **{
        f"a table and JSON at {name}": (f"{BRANCH} --csv {name} --json", r"--json goes there; give")
        for name in ("-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1")
    },
    "impacts and JSON": (f"{LOST} --impacts - --json", r"--impacts /dev/stdout: --json goes there"),
    "a state and JSON": (f"{LOST} --final=- --json", r"--final -: --json goes there"),
    "an atlas and JSON": ("atlas --k 0.8 --csv - --json", r"--csv /dev/stdout: --json goes there"),
    "two tables": (
        f"{LOST} --impacts - --csv /dev/fd/1",
        r"--csv goes there; give",
    ),
    "what is kept": (f"{BRANCH} --save -", r"cannot keep results in /dev/stdout: .* name a file"),
    "an atlas twice": ("atlas --k 0.8 --save a.nc --csv ./a.nc", r"--csv and --save both name"),
    "the first state": (
        f"{LOST} --start two.csv --csv ./two.csv",
        r"--start and --csv both name \./two\.csv; give different names",
    ),
    "the lattice": (
        f"{BRANCH} --lattice falling.csv --csv falling.csv",
        r"--lattice and --csv both name falling\.csv",
    ),
    "the file that is shown": ("show words.txt --csv words.txt", r"RUN and --csv both name"),
    "a hard link": (f"{LOST} --csv words.txt --impacts same.txt", r"give different names"),
    "a letter twice": (
        f"{BRANCH} --forcing 'c*cos(t)' --set c=1 --set c=2",
        r"--set: c is given twice, 1\.0 and 2\.0",
    ),
}
OF_STUDIES = {
    "no workers": ("run study.toml --workers -3", r"--workers: -3: at least one process was"),
    "a folder without a name": (
        "run study.toml --folder ''",
        r"name of the file to write is empty",
    ),
    "too many": ("run many.toml", r"many\.toml, line 2, .* 1000000000 values from 0\.1 to 0\.9: a"),
    "to infinity": ("run far.toml", r"far\.toml, line 2, zones\.z\.k: values = inf: .* finite"),
    "too many together": ("run grid.toml", r"1000 of k times 1000 of c are 1000000 combinations"),
}
OF_THE_EXPLORER = {
    "no file": ("explore --headless missing.nc", r"missing\.nc"),
    "no port": ("explore --headless --port 70000", r"port"),
    "negative port": ("explore --headless --port -1", r"port = -1"),
    "another machine": (
        "explore --headless --address 203.0.113.7",
        r"cannot listen at 203\.0\.113\.7",
    ),
    "no origin": ("explore --headless --origin ''", r"origin '': HOST:PORT was expected"),
    "origin of a page": ("explore --headless --origin http://a:1/", r"origin 'http://a:1/': HOST"),
    "k above one": ("explore --headless --k 2", r"k = 2\.0"),
}
REFUSED = {
    f"{family}: {name}": case
    for family, cases in (
        ("chain", OF_THE_CHAIN), ("lattice", OF_LATTICES), ("switch", OF_SWITCHING),
        ("run", OF_RUNS), ("atlas", OF_ATLASES), ("place", OF_PLACES),
        ("study", OF_STUDIES), ("explorer", OF_THE_EXPLORER),
    )
    for name, case in cases.items()
}  # fmt: skip

FILES = {
    "words.txt": "to be or not\n",
    "half.json": '{"u": [0.1]}',
    "two.csv": "0.1,0.2\n0,0\n",
    "out.csv": "u,v\n1.5,0\n0,0\n",
    "study.toml": "[zones.z]\nk = 0.8\n",
    "many.toml": "[zones.z]\nk = {from = 0.1, to = 0.9, count = 1000000000}\n",
    "far.toml": "[zones.z]\nk = {from = 0.1, to = inf, count = 3}\n",
    "grid.toml": "[chain]\nforcing = 'cos(t)+c*cos(3*t)'\nparameters = {c = 0.1}\n[zones.z]\n"
    "k = {from = 0.1, to = 0.9, count = 1000}\nover = {c = {from = 0, to = 1, count = 1000}}\n",
}


def plant() -> None:
    """Files that are no lattices, and no states."""
    for name, text in FILES.items():
        Path(name).write_text(text)
    Path("same.txt").hardlink_to("words.txt")
    write_matrix("lopsided.csv", [[1, -1], [-0.5, 1]])
    write_matrix("falling.csv", [[0, 1], [1, 0]])
    write_matrix("ragged.csv", [[1, -1], [1]])
    write_matrix("wide.csv", [[1, -1, 0], [-1, 1, 0]])
    write_matrix("nan.csv", [["nan", -1], [-1, 1]])
    write_matrix("words.csv", [["one", "two"], [1, 2]])
    Path("bytes.csv").write_bytes(bytes(range(128, 256)))
    Path("empty.csv").touch()
    Path("folder.csv").mkdir()
    Path("broken.graphml").write_text("<graphml><graph", encoding="utf-8")
    Path("page.graphml").write_text("<html/>", encoding="utf-8")
    pair = nx.path_graph(2)
    nx.write_graphml(nx.DiGraph([(0, 1)]), "arrows.graphml")
    for name, edge in (("stiff", "very"), ("push", -1.0)):
        nx.set_edge_attributes(pair, edge, "weight")
        nx.write_graphml(pair, f"{name}.graphml")
    for name, mass in (("heavy", -2.0), ("lead", "a lot")):
        weighed = nx.path_graph(3)
        weighed.nodes[1]["mass"] = mass
        nx.write_graphml(weighed, f"{name}.graphml")
    apart = nx.path_graph(2)
    apart.add_node(2)
    nx.write_graphml(apart, "apart.graphml")


@pytest.mark.parametrize(("line", "sentence"), REFUSED.values(), ids=REFUSED)
def test_bad_input_is_one_sentence_and_status_2(run: Run, line: str, sentence: str) -> None:
    plant()
    before = sorted(Path().iterdir())
    status, out, err = run(line)
    assert (status, out) == (BAD_INPUT, ""), err
    assert err.startswith("contbreather: ")
    assert err.count("\n") == 1
    assert "Traceback" not in err
    assert re.search(sentence, err), err
    assert sorted(Path().iterdir()) == before  # nothing half done is left
