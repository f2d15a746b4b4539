"""How right `hmpim.identify` is, family by family of records.

python benchmarks/families [--families NAME,...] [--draws N] [--seed S] [--jobs 2]
                           [--samples N] [--json OUT] [--against OLD] [--list] [--explain INDEX]
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path


def arguments() -> argparse.Namespace:
    from families.study import SEED

    parser = argparse.ArgumentParser(
        prog="python benchmarks/families", description=__doc__.split("\n")[0]
    )
    parser.add_argument("--families", default="", help="names or parts of names, with commas; all")
    parser.add_argument("--draws", type=int, default=50, help="of each family (50)")
    parser.add_argument(
        "--seed", type=int, default=SEED, help=f"another seed, other draws ({SEED})"
    )
    parser.add_argument(
        "--samples",
        type=int,
        help="samples per record (600 to 3000), except in families about record length",
    )
    parser.add_argument("--jobs", type=int, default=2, help="processes (2)")
    parser.add_argument(
        "--json", type=Path, help="write the counts here; families not drawn now stay"
    )
    parser.add_argument("--detail", type=Path, help="write every draw here, figure by figure")
    parser.add_argument("--against", type=Path, help="an earlier --json: say what moved")
    parser.add_argument("--list", action="store_true", help="name the families")
    parser.add_argument("--explain", type=int, help="one draw, figure by figure, beside its truth")
    parser.add_argument(
        "--no-options", action="store_true", help="do not tell identify what it could be told"
    )
    return parser.parse_args()


def main() -> int:
    from families import kinds, study, table
    from families.catalogue import FAMILIES, named

    given = arguments()
    try:
        names = named(given.families)
    except KeyError as error:
        print(f"no family is called {error}; --list names them", file=sys.stderr)
        return 2
    if given.list:
        for name in names:
            print(f"{name:32s}{FAMILIES[name].words}")
        return 0
    told = not given.no_options
    if given.samples is not None and given.samples < 50:
        print(f"--samples {given.samples} is too short; 50 or more", file=sys.stderr)
        return 2
    kinds.set_samples(given.samples)
    if given.explain is not None:
        for name in names:
            print("\n".join(study.explained(name, given.seed, given.explain, options=told)))
        return 0

    def tell(name: str, scores: list) -> None:
        row = table.summary(scores)
        seen = ", ".join(f"{n} {cell}" for cell, n in row["cells"].items() if n)
        print(f"{name}: {seen}", file=sys.stderr, flush=True)
        if given.json:
            table.write({name: row}, given.json, seed=given.seed)

    scores = study.run(
        names,
        draws=given.draws,
        seed=given.seed,
        jobs=given.jobs,
        options=told,
        samples=given.samples,
        tell=tell,
    )
    rows = {name: table.summary(found) for name, found in scores.items()}
    print("\n".join(table.markdown(rows)))
    if given.detail:
        table.write_detail(scores, given.detail)
    if given.against:
        print(f"\nMoved since {given.against}, in percent:\n")
        print("\n".join(table.moved(rows, table.read(given.against))))
    return 0


if __name__ == "__main__":
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    sys.path.insert(0, str(Path(__file__).parents[1]))
    sys.exit(main())
