"""The command line of the benchmarks."""

import argparse
import json
from collections.abc import Callable
from pathlib import Path

Measure = Callable[[bool], dict]
Table = Callable[[dict], str]


def run_part(doc: str, measure: Measure, table: Table) -> None:
    """Run one benchmark: print its table and write its JSON file."""
    run_all(doc, {'': (measure, table)})


def run_all(doc: str, parts: dict[str, tuple[Measure, Table]]) -> None:
    """Run benchmarks one after another; the JSON file has their results by name."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument('--quick', action='store_true', help='shorter, and less to be trusted')
    parser.add_argument('--json', type=Path, metavar='FILE', help='also write the figures here')
    args = parser.parse_args()
    results = {}
    for name, (measure, table) in parts.items():
        results[name] = measure(args.quick)
        print(f'{name.upper()}\n{table(results[name])}\n'.lstrip(), flush=True)
        if args.json:
            args.json.write_text(json.dumps(results, indent=1))
