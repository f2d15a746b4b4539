"""Where each number of identification comes from, and what 30 % of it does: docs/thresholds.md.

python benchmarks/thresholds            write the page by the effects that are stored
python benchmarks/thresholds --measure  watch the draws, run what decides again, write both
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path


def measure(count: int, jobs: int, seconds: float, trace: Path | None) -> None:
    """Measure the tuned numbers: those that decide in the fewest draws first.

    Each is stored once all its draws are done; with the same trace, only those left are run.
    """
    from thresholds.effects import draws, perturbed, traced
    from thresholds.table import EFFECTS, origins

    if trace is not None and trace.exists():
        base = {(name, k): seen for name, k, seen in json.loads(trace.read_text())}
    else:
        base = traced(draws(count), jobs=jobs)
    if trace is not None:
        trace.write_text(json.dumps([[*draw, seen] for draw, seen in base.items()]))
    tuned = origins()[1]
    where = {key: [d for d, seen in base.items() if key in seen["moved"]] for key in tuned}
    cost = {key: sum(base[d]["seconds"] for d in where[key]) for key in tuned}
    order = sorted(tuned, key=lambda key: cost[key])
    cells = [seen["cell"] for seen in base.values()]
    run = {
        "draws": len(base),
        "each": count,
        "right_ok": cells.count("right_ok"),
        "wrong_ok": cells.count("wrong_ok"),
        "moved": {key: len(where[key]) for key in order},
    }
    numbers = {}
    if trace is not None and EFFECTS.exists():
        stored = json.loads(EFFECTS.read_text())
        numbers = stored["numbers"] if stored["run"] == run else {}
    left = [key for key in order if key not in numbers]
    tasks = [(key, end, draw) for key in left for end in (0, 1) for draw in where[key]]
    open_ = {key: 2 * len(where[key]) for key in left}
    found = {key: {"less": [0, 0, 0], "more": [0, 0, 0]} for key in left}

    def store() -> None:
        numbers.update({key: found[key] for key in left if open_[key] == 0})
        EFFECTS.write_text(json.dumps({"run": run, "numbers": numbers}, indent=1) + "\n")

    begin = time.time()
    store()
    for (key, end, draw), seen in perturbed(tasks, jobs=jobs, seconds=seconds):
        was, now = base[draw]["cell"], seen["cell"]
        effect = found[key]["more" if end else "less"]
        effect[0] += (now == "right_ok") - (was == "right_ok")
        effect[1] += (now == "wrong_ok") - (was == "wrong_ok")
        effect[2] += now != was
        open_[key] -= 1
        if open_[key] == 0:
            store()
    print(f"{len(tasks)} draws again in {time.time() - begin:.0f} s", file=sys.stderr)


def main() -> int:
    from thresholds.table import PAGE, page

    parser = argparse.ArgumentParser(
        prog="python benchmarks/thresholds", description=__doc__.split("\n")[0]
    )
    parser.add_argument("--measure", action="store_true", help="run the draws; else write the page")
    parser.add_argument("--draws", type=int, default=5, help="of each family (5: a tenth)")
    parser.add_argument("--jobs", type=int, default=2, help="processes (2)")
    parser.add_argument(
        "--seconds", type=float, default=1e9, help="to spend on changed numbers at most"
    )
    parser.add_argument(
        "--trace",
        type=Path,
        help="what was watched: read if there, else written; stopped, the same command goes on",
    )
    given = parser.parse_args()
    if given.measure:
        measure(given.draws, given.jobs, given.seconds, given.trace)
    PAGE.write_text(page())
    return 0


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))
    sys.exit(main())
