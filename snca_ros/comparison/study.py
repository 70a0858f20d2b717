"""A study: the comparison of results of campaigns, its tables and its files."""

from collections.abc import Sequence
from pathlib import Path

from snca_ros.comparison.pairwise import (
    COLUMNS,
    contrasts,
    contrasts_csv,
    contrasts_rows,
    shown_contrasts,
)
from snca_ros.comparison.runs import missing_runs, read_cases, warnings
from snca_ros.comparison.tables import (
    Table,
    champions_table,
    contrasts_table,
    factors_table,
    speeds_table,
    titled_list,
    vibration_table,
)


class Study:
    """A comparison of the runs of results folders.

    Args:
        results: results folders of campaigns; their tables are joined.
        campaigns: campaign files, whose runs alone are compared; without files, all runs.

    Attributes:
        warnings: lines that describe why the comparison may be misleading.
        missing: lines that name runs without results.

    Raises:
        InvalidInput: a table or a campaign file cannot be read or is invalid.
    """

    def __init__(self, results: Sequence[Path], campaigns: Sequence[Path] = ()) -> None:
        self._cases = read_cases(results, campaigns)
        self._contrasts = contrasts(self._cases)
        self._shown = shown_contrasts(self._contrasts)
        self.warnings = warnings(self._cases)
        self.missing = missing_runs(self._cases, campaigns)
        self._tables = [
            speeds_table(self._cases), champions_table(self._cases),
            vibration_table(self._cases), factors_table(self._cases),
        ]

    def summary(self) -> str:
        """Return tables, warnings and missing runs in Markdown."""
        return '\n\n'.join([
            *(table.markdown() for table in self._with(contrasts_table(self._shown))),
            *titled_list('Warnings', self.warnings), *titled_list('Missing', self.missing),
        ])

    def files(self) -> dict[str, str]:
        """Return the files of the study, name to text: index.html, statistics.csv and SVG files."""
        from snca_ros.comparison.figures import draw_all  # matplotlib loads slowly
        from snca_ros.comparison.page import page

        figures = draw_all(self._cases, self._shown)
        tables = self._with(contrasts_table(self._contrasts))
        return {
            **{f'{kind}-{shape}.svg': svg for kind, shape, svg in figures},
            'statistics.csv': contrasts_csv(self._contrasts),
            'index.html': page(self._cases, self.missing, self.warnings, tables, figures),
        }

    def as_dict(self) -> dict[str, object]:
        """Return comparisons, tables, warnings and missing runs as a dictionary for JSON."""
        rows = contrasts_rows(self._contrasts)
        return {
            'comparisons': [dict(zip(COLUMNS, row, strict=True)) for row in rows],
            'tables': {
                table.title: [dict(zip(table.header, row, strict=True)) for row in table.rows]
                for table in self._tables
            },
            'warnings': self.warnings, 'missing': self.missing,
        }

    def _with(self, table: Table) -> list[Table]:
        return [table for table in (*self._tables, table) if table.rows]
