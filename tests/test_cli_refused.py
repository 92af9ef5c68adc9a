"""Whatever the command line cannot use is one sentence and status 2, and leaves nothing."""

from __future__ import annotations

import re
from pathlib import Path

import networkx as nx
import pytest

from contbreather.cli import BAD_INPUT

from .typed import Run, write_matrix

START = {  # what lines begin with, by a word
    "POINT": "point --a 0.5 --gamma 0.12 --k 0.4",
    "BRANCH": "branch --free a --gamma 0.1 --k 0.8",
    "HERE": "point --a 0.6 --gamma 0.05 --k 0.8",
    "SWITCH": "switch --free a --gamma 0.04 --k 0.8",
    "DIAGRAM": "diagram --free a --gamma 0.04 --k 0.8",
    "DAMPED": "simulate --a 0.1 --gamma 0.08 --k 0.8 --damping",
    "LOST": "simulate --a 0.2 --gamma 0.104 --k 0.8 --damping 0.005",
}
# A line that is typed, and what its sentence has, as a regular expression.
REFUSED = r"""
# by the parser
point --a half --gamma 0.1 --k 0.8 >> --a: unable to convert "half"
point --a >> parameter --a requires an argument\. See contbreather point --help\.$
point --gamma 0.1 --k 0.8 >> --a is missing: the amplitude of the forcing, above 0$
POINT --sites 2.5 >> --sites: 2\.5 is not a whole number
POINT --amplitude 3 >> Unknown option.*--amplitude
POINT more >> 'more' belongs to no option; each value follows the name of its own
figure 4 --walls -2,2 >> Unknown option: --walls\. See contbreather figure --help
zone >> Unknown command "zone"\. Did you mean "zones"\? See contbreather --help
trace >> Unknown command "trace"; there are point, branch, .*, run\. See contbreather --help
branch --gamma 0.1 --k 0.8 >> parameter --free requires an argument
run >> parameter STUDY requires an argument
BRANCH --towards left >> "both", "up", "down"
BRANCH --window 0.5 >> --window requires 2 positional arguments\. Only got 1
atlas --k 0.8 --workers 0 >> Invalid value "0" for --workers\. Must be >= 1
# of the chain
zones --k 1 >> zones need 0 < k < 1
point --a nan --gamma 0.1 --k 0.8 >> a = nan: .* finite
POINT --forcing 'cos(t' >> is not a formula
POINT --forcing '-cos(t)-c*cos(3*t)' >> needs a value for c
POINT --forcing 'c*cos(t)' --set c=0 >> is zero at c = 0;
POINT --set c=1 >> unknown forcing parameter c
POINT --set c=lots >> NAME=VALUE was expected
POINT --set =1 >> NAME=VALUE was expected
BRANCH --forcing 'c*cos(t)' --set c=1 --set c=2 >> --set: c is given twice, 1\.0 and 2\.0
point --a 0.5 --gamma 0.1 --k 0.8 --root 3
    >> root 3: the solutions of \(11\) are 1: p = 0\.767381929, 2: p = 0\.257470095; choose
BRANCH --root 0 >> root = 0: a whole
POINT --threshold 1.005 >> threshold = 1\.005: the infinite chain has none
zones --k 0.8 --threshold 1.01 >> threshold = 1\.01: the infinite chain has none
POINT --sites 10 --threshold 0.9 >> threshold = 0\.9
BRANCH --window 0.9 0.5 >> the window of 'a' is empty: \(0\.9, 0\.5\)
branch --free gamma --a 0.5 --k 0.8 --window 0.3 0.4 >> 0 <= gamma < 1/4
BRANCH --a 0.7 --window 0.1 0.6 >> the start has a=0\.7, outside \(0\.1, 0\.6\)
zones --gamma-window 0.3 0.4 >> leaves nothing of \(0\.0, 0\.2499\)
zones --gamma-window 0.2 0 >> of 'gamma' is empty
zones --k 0.8 --gamma-window 0.02 0.03 --a-window 0.3 0.4 >> no curve passes the window
zones --a 2 >> no breather at a = 2 for k between 0\.01 and 0\.999 and gamma between 0 and 0\.2499;
zones --k 0.8 --gamma 0.05 --a 0.5 >> values of exactly one of k, gamma, a, got k, gamma, a
boundary HB --k 0.8 >> the kind must be 'LP', 'PF', 'NS', 'GR' or 'PD', got 'HB'
boundary PF --pair a a --k 0.8 >> two different parameters
boundary PF --pair a b --k 0.8 >> the parameter must be .*, got 'b'
boundary PF --k 0.8 --window 0.1 0.2 >> no PF found for gamma between 0\.1 and 0\.2
figure 9 >> there are the figures 2, 3, 4, 5, 6, 7, 8
# of lattices
HERE --lattice cube:3 >> --lattice cube:3: expected ring:20, open
HERE --lattice open:9 --sites 9 >> --lattice open:9 and --sites 9: give one of the two
HERE --lattice nowhere.csv >> cannot read nowhere\.csv: No such file
HERE --lattice bytes.csv >> cannot read bytes\.csv: it is not text
HERE --lattice page.graphml >> no graph in page\.graphml
HERE --lattice push.graphml >> must be positive semidefinite
HERE --lattice open:9 --site 9 >> no such site on the open chain
HERE --lattice open:9 --walls 1,-1 >> two numbers low < high
HERE --lattice open:9 --damping -1 >> damping = -1\.0: .* 0 <= dam
HERE --spring 0.9 >> gamma = 0\.05, spring = 0\.9: the band .* must stay below 1
HERE --damping 0.1 >> take a ring or another
branch --free damping --a 0.6 --gamma 0.05 --k 0.8 --window 0.01 0.1 >> on the infinite chain
SWITCH --lattice open:9 --threshold 1.02 >> Unknown option.*--threshold
DIAGRAM --sites 9 --threshold 1.005 >> Unknown option.*--threshold
zones --damping 0.1 >> on the infinite chain site 0 impacts
zones --damping 0.1 --sites 6 --past-folds
    >> past_folds: lower breathers are drawn on the infinite chain, or on a ring
# of switching
SWITCH --at NS >> --at NS: there is none.* It has VI1, LP1, PF1, GR1
SWITCH --at PF --at PD >> asymmetric breather.* It has EP1, GR1
SWITCH --at LP >> LP1.*no other branch is known to leave points of kind LP
SWITCH --window 0.5 0.9 --at EP >> EP1.* is where a branch ends
DIAGRAM --depth 1.2 >> 1\.2 is not a whole number
DIAGRAM --depth -1 >> depth = -1: a whole number, at least 0
DIAGRAM --most 0 >> most = 0: a whole number, at least 1
# of runs
simulate --gamma 0.1 --k 0.8 >> --a is missing
simulate --a 0.1 --gamma 0.3 --k 0.8 >> 0 <= gamma < 1/4
simulate --a 1.05 --gamma 0.1 --k 0.8 >> site 1 reaches .* give a state with --start
simulate --a 1.05 --gamma 0.2 --k 0.8 >> [^.]; give a state with --start instead\n
simulate --a 0.6 --gamma 0.05 --k 0.8 --sites 9 --threshold 1.02 >> Unknown option.*--threshold
LOST --walls -2,2 --smooth 6 >> --walls goes with rigid walls only: leave out --smooth
LOST --stream f.nc --smooth 6 >> --stream goes with rigid walls
LOST --impacts f.csv --smooth 6 >> --impacts goes with rigid walls
LOST --stream f.nc --periods 2.5 >> periods = 2\.5: a whole number
LOST --periods 1e11
    >> the states of 20 sites once in each would be 3\.2e\+04 GB.* may have 1; .* --stream
LOST --smooth 0.3 >> m = 0\.3: the hardness .* 0\.5 <= m .* any real one
LOST --perturb 5 >> lies outside the walls
LOST --perturb 1e308 >> a standard deviation, from 0 to 1e6, a finite number, was expected
LOST --perturb -1 >> --perturb = -1.0: a standard deviation, from 0 to 1e6
LOST --perturb 0.1 --seed -1 >> --seed = -1: a whole number
LOST --start nothing.json >> cannot read nothing\.json: .*JSON with u, v
LOST --start words.txt >> no state in words\.txt: JSON with u, v
LOST --start half.json >> no state in half\.json
LOST --start two.csv --sites 5 >> has 2 sites; leave out --sites
LOST --start out.csv >> u\[0\] = 1\.5 lies outside the walls
# of atlases
atlas >> values of exactly one of k, gamma, a
atlas --k 0.8:0.9 >> neither a number nor LOW:HIGH:COUNT
atlas --k 0.8 --over c3 >> NAME=VALUE,VALUE,\.\.\. was expected
atlas --k 0.8 --over c3=1 >> unknown forcing parameter c3
atlas --k 0.1:0.9:1000 --over c=0:1:101 --forcing 'cos(t)+c*cos(3*t)'
    >> 1000 of k times 101 of c are 101000 combinations: at most 100000
atlas --k 0.8 --over c=0:1:3 --set c=2 --forcing 'cos(t)+c*cos(3*t)' >> c is given twice
atlas --k 0.8 --over lattice=0:1:3 --forcing 'cos(t)+lattice*cos(3*t)'
    >> --over lattice: this name is taken; rename it in the formula
# of places
BRANCH --y p >> --y p: nothing is drawn; name a figure, -o branch\.png
BRANCH --csv '' >> name of the file to write is empty
zones -o . >> it is a directory
LOST --final nowhere/f.json >> there is no directory nowhere
zones -o zones.jpeg >> suffix must be one of
atlas --k 0.8 --save a.csv >> a netCDF-4 file, call it a\.nc
BRANCH --csv /proc/b.csv >> cannot write /proc/b\.csv
BRANCH --csv b.png -o b.png >> different names
LOST --csv a.csv --impacts ./a.csv >> give different names
LOST --final a.png -o ./a.png >> give different names
atlas --k 0.8 --save a.nc --csv ./a.nc >> --csv and --save both name
LOST --start two.csv --csv ./two.csv
    >> --start and --csv both name \./two\.csv; give different names
BRANCH --lattice falling.csv --csv falling.csv >> --lattice and --csv both name falling\.csv
show words.txt --csv words.txt >> RUN and --csv both name
LOST --csv words.txt --impacts same.txt >> give different names
BRANCH --csv - --json >> --json and --csv both name
LOST --final=- --json >> --json and --final both name -
LOST --impacts - --csv /dev/fd/1 >> --csv and --impacts both name
BRANCH --save - >> cannot keep results in /dev/stdout: .* name a file
# of studies
run nowhere.toml >> nowhere\.toml
run x.toml --workers 1 --cluster tcp://a:1 >> --workers 1 and --cluster tcp.*: give one of the two
run study.toml --folder '' >> name of the file to write is empty
run many.toml >> many\.toml, line 2, .* 1000000000 values from 0\.1 to 0\.9: a
run grid.toml >> 1000 of k times 1000 of c are 1000000 combinations
# of the explorer
explore --headless missing.nc >> missing\.nc
explore --headless --port 70000 >> port
explore --headless --address 203.0.113.7 >> cannot listen at 203\.0\.113\.7
explore --headless --origin '' >> origin '': HOST:PORT was expected
explore --headless --k 2 >> k = 2\.0
"""
CASES = [
    [part.strip() for part in case.split(">>")]
    for case in re.sub(r"\n +>>", " >>", REFUSED).splitlines()
    if ">>" in case
]

FILES = {
    "words.txt": "to be or not\n",
    "half.json": '{"u": [0.1]}',
    "two.csv": "0.1,0.2\n0,0\n",
    "out.csv": "u,v\n1.5,0\n0,0\n",
    "study.toml": "[zones.z]\nk = 0.8\n",
    "many.toml": "[zones.z]\nk = {from = 0.1, to = 0.9, count = 1000000000}\n",
    "grid.toml": "[chain]\nforcing = 'cos(t)+c*cos(3*t)'\nparameters = {c = 0.1}\n[zones.z]\n"
    "k = {from = 0.1, to = 0.9, count = 1000}\nover = {c = {from = 0, to = 1, count = 1000}}\n",
}


def plant() -> None:
    """Files that are no lattices, and no states."""
    for name, text in FILES.items():
        Path(name).write_text(text)
    Path("same.txt").hardlink_to("words.txt")
    write_matrix("falling.csv", [[0, 1], [1, 0]])
    Path("bytes.csv").write_bytes(bytes(range(128, 256)))
    Path("folder.csv").mkdir()
    Path("page.graphml").write_text("<html/>", encoding="utf-8")
    pair = nx.path_graph(2)
    nx.set_edge_attributes(pair, -1.0, "weight")
    nx.write_graphml(pair, "push.graphml")


@pytest.mark.parametrize(("line", "sentence"), CASES)
def test_bad_input_is_one_sentence_and_status_2(run: Run, line: str, sentence: str) -> None:
    plant()
    before = sorted(Path().iterdir())
    begin, *rest = line.split(" ", 1)
    status, out, err = run(" ".join([START.get(begin, begin), *rest]))
    assert (status, out) == (BAD_INPUT, ""), err
    assert err.startswith("contbreather: ")
    assert err.count("\n") == 1
    assert "Traceback" not in err
    assert re.search(sentence, err), err
    assert sorted(Path().iterdir()) == before  # nothing half done is left
