#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws the studies in results folders of `probelab run`: for each a figure as PDF and PNG, a CSV
of what is plotted and a caption (.txt), in DIR/figures. Of a study that is not finished it draws
what is there, and the caption says how much that is. Needs matplotlib (Debian: python3-matplotlib).

  scripts/figures.py results/runs/error_vs_n results/runs/thin_wall
  scripts/figures.py results/runs/* -o results/figures --only speed_error
"""
import argparse
import csv
import io
import pathlib
import sys

from figures_captions import caption
from figures_cells import InputError, cell_files, load_folder
from figures_tables import DAMAGE, READABLE, TABLES, drawable, kind_of
from pipeline_report import aligned, number
from whole_output import no_matplotlib, of_system, whole_folder


def table_text(rows):
    columns = list(dict.fromkeys(column for row in rows for column in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({k: "" if v is None else f"{v:.9g}" if isinstance(v, float) else v
                         for k, v in row.items()})
    return text.getvalue()


def markdown(rows):
    columns = list(dict.fromkeys(column for row in rows for column in row))
    texts = sum(any(isinstance(r.get(c), str) for r in rows) for c in columns)
    cell = lambda v: v if isinstance(v, str) else f"{v:,}" if isinstance(v, int) else number(v)
    return aligned([columns] + [[cell(r.get(c)) for c in columns] for r in rows], texts) + "\n"


def write_tables(study, kind, folder):
    """The tables of a study and their files' names."""
    tables, written = TABLES[kind](study), []
    if not any(tables.values()):
        raise InputError(f"{study.folder}: none of the {len(study.cells)} cells of '{study.name}' "
                         "has the numbers that its figure shows")
    for suffix, rows in tables.items():
        if not rows:
            continue
        path = folder / (file_stem(study, suffix) + ".csv")
        path.write_text(table_text(rows))
        written.append(path)
        if suffix in READABLE:
            path = path.with_suffix(".md")
            path.write_text(markdown(rows))
            written.append(path)
    return tables, written


def file_stem(study, suffix):
    return f"{study.name}_{suffix}" if suffix else study.name


def draw_study(pyplot, study, kind, folder, damaged):
    """Writes all files of a study, or none; returns their paths."""
    import figures_curves
    import figures_dots
    import figures_extra
    import figures_panels
    name = f"draw_{kind}"
    draw = next(getattr(module, name) for module in (figures_curves, figures_dots, figures_extra)
                if hasattr(module, name))
    with whole_folder(folder) as part:
        tables, written = write_tables(study, kind, part)
        for suffix, figure in draw(pyplot, study, tables).items():
            stem = file_stem(study, suffix)
            written += [part / name for name in figures_panels.save(figure, part, stem)]
            (part / f"{stem}.txt").write_text(caption(kind, suffix, study, tables, damaged))
            written.append(part / f"{stem}.txt")
    return [folder / path.name for path in written]


def note(text):
    print(f"figures.py: {text}", file=sys.stderr)


def choose(folder, studies, only):
    """(study, kind) of those that can be drawn and are wanted; says which cannot."""
    chosen = []
    for study in studies:
        kind = kind_of(study)
        if kind is None:
            hint = "; scripts/tuning_figure.py draws tuning" if study.command == "tune" else ""
            note(f"{folder}: no figure is known for study '{study.name}'{hint}")
        elif not only or study.name in only or kind in only:
            chosen.append((study, kind))
    return chosen


def with_cells(folders):
    """Those of several folders that have cells; a single one says itself what it lacks."""
    for folder in folders:
        if not folder.exists():
            raise InputError(f"{folder}: no such folder")
    if len(folders) == 1:
        return folders
    kept = [folder for folder in folders if cell_files(folder)]
    if not kept:
        raise InputError(f"{', '.join(map(str, folders))}: no cells in any of them; "
                         "'probelab run STUDY --results DIR' makes them")
    for folder in folders:
        if folder not in kept:
            note(f"{folder}: no cells; left out")
    return kept


def planned(options):
    """(study, kind, output folder, damaged cells of its folder) to draw, and all damaged cells."""
    work, all_damaged, sources = [], 0, {}
    for folder in with_cells(options.folders):
        studies, damaged = load_folder(folder)
        for line in damaged:
            note(line)
        all_damaged += len(damaged)
        for study, kind in choose(folder, studies, options.only):
            target = options.output or folder / "figures"
            other = sources.setdefault((target, study.name), folder)
            if other != folder:
                raise InputError(f"{folder}: study '{study.name}' is in {other} too; give them "
                                 "separate output folders")
            work.append((study, kind, target, len(damaged)))
    if not work:
        only = f" named {' or '.join(options.only)}" if options.only else ""
        raise InputError(f"{', '.join(map(str, options.folders))}: no study{only} to draw")
    return work, all_damaged


def draw_whole(pyplot, study, kind, target, damaged):
    """Draws what of a study can be; whether all could. Raises InputError."""
    study, lines = drawable(study, kind)
    for line in lines + [f"{study.folder}: {study.name}: {text}" for text in study.left_out]:
        note(line)
    try:
        for path in draw_study(pyplot, study, kind, target, damaged + len(lines)):
            print(path)
    except DAMAGE as error:
        raise InputError(f"{study.folder}: study '{study.name}' cannot be drawn, its cells lack "
                         f"something: {type(error).__name__}: {error}") from error
    return not lines


def run(options):
    """Exit code; raises InputError."""
    work, damaged = planned(options)
    failed = damaged > 0
    try:
        from figures_panels import load_pyplot
        pyplot = load_pyplot()
    except ImportError as error:
        raise InputError(no_matplotlib(error)) from error
    for one in work:
        try:
            failed = not draw_whole(pyplot, *one) or failed
        except InputError as error:  # the other studies are drawn all the same
            note(error)
            failed = True
    return 1 if failed else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", metavar="DIR", nargs="+", type=pathlib.Path,
                        help="results of a study, as given to probelab run --results")
    parser.add_argument("-o", "--output", metavar="OUT", type=pathlib.Path,
                        help="one folder for all figures (default: DIR/figures)")
    parser.add_argument("--only", metavar="NAME", action="append", choices=sorted(TABLES),
                        help="draw this study alone; may be repeated: " + ", ".join(sorted(TABLES)))
    options = parser.parse_args()
    try:
        return run(options)
    except InputError as error:
        note(error)
        return 2
    except OSError as error:
        note(of_system(error))
        return 1


if __name__ == "__main__":
    sys.exit(main())
