"""How right `hmpim.identify` is, family by family of records.

python benchmarks/families [--families NAME,...] [--draws N] [--seed S] [--jobs 2]
                           [--json OUT] [--against OLD] [--list]
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path


def main() -> int:
    from families.catalogue import FAMILIES
    from families.study import SEED, run
    from families.table import markdown, moved, summary

    parser = argparse.ArgumentParser(
        prog="python benchmarks/families", description=__doc__.split("\n")[0]
    )
    parser.add_argument("--families", default="", help="names or parts of names, with commas; all")
    parser.add_argument("--draws", type=int, default=50, help="of each family (50)")
    parser.add_argument(
        "--seed", type=int, default=SEED, help=f"another seed, other draws ({SEED})"
    )
    parser.add_argument("--jobs", type=int, default=2, help="processes (2)")
    parser.add_argument("--json", type=Path, help="write counts, and every draw, here")
    parser.add_argument("--against", type=Path, help="an earlier --json: say what moved")
    parser.add_argument("--list", action="store_true", help="name the families")
    parser.add_argument(
        "--no-options", action="store_true", help="do not tell identify what it could be told"
    )
    given = parser.parse_args()
    wanted = [part.strip() for part in given.families.split(",") if part.strip()]
    names = [n for n in FAMILIES if not wanted or n in wanted]
    for part in wanted:
        if part not in FAMILIES:
            found = [n for n in FAMILIES if part.lower() in n.lower()]
            if not found:
                parser.error(f"no family is called {part!r}; --list names them")
            names += [n for n in found if n not in names]
    if given.list:
        for name in names:
            print(f"{name:32s}{FAMILIES[name].words}")
        return 0

    def tell(name: str, scores: list) -> None:
        row = summary(scores)
        print(f"{name}: {row['cells']}, {row['seconds'][1]} s at most", file=sys.stderr, flush=True)

    scores = run(
        names,
        draws=given.draws,
        seed=given.seed,
        jobs=given.jobs,
        options=not given.no_options,
        tell=tell,
    )
    rows = {name: summary(found) for name, found in scores.items()}
    print("\n".join(markdown(rows)))
    if given.json:
        draws = {name: [s.plain() for s in found] for name, found in scores.items()}
        kept = {"seed": given.seed, "families": rows, "draws": draws}
        given.json.write_text(json.dumps(kept, allow_nan=True) + "\n", encoding="utf-8")
    if given.against:
        old = json.loads(given.against.read_text(encoding="utf-8"))["families"]
        print("\nMoved since " + str(given.against) + ", in percent:\n")
        print("\n".join(moved(rows, old)))
    return 0


if __name__ == "__main__":
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    sys.path.insert(0, str(Path(__file__).parents[1]))
    sys.exit(main())
