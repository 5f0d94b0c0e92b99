"""The command line: `trigpoint demo, new, info, align, compare, apply, audit, verify`."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console

import trigpoint
from trigpoint.alignment import align as fit_picks
from trigpoint.canonical import plain, to_json, write_text
from trigpoint.comparison import WITHIN_M, measure
from trigpoint.consensus import Method
from trigpoint.crs import parse_crs
from trigpoint.errors import RegionError, SettingError, TrigpointError
from trigpoint.files import carry
from trigpoint.inspection import inspect
from trigpoint.pipeline import try_icp
from trigpoint.preparation import Reference, prepare, thin
from trigpoint.repeats import repicked
from trigpoint.results import (
    alignment_results,
    comparison_results,
    read_sigma,
    read_similarity,
    trial_results,
    warning_results,
)
from trigpoint.starter import start_project
from trigpoint.surface import Surface
from trigpoint_reporting import console as people
from trigpoint_reporting.batch import write_index
from trigpoint_reporting.bundling import check_places, deliver
from trigpoint_reporting.verification import verify as verify_bundle

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Carry a neural reconstruction into a geodetic frame with one similarity, "
    "and say what it is worth.",
)

# What a shell reports of a program that wrote to a closed pipe.
BROKEN_PIPE = 141
# What Typer makes of Ctrl-C.
INTERRUPTED = 130

AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
Crs = Annotated[str, typer.Option(help="Assign a CRS, such as EPSG:32615; it never reprojects.")]
Existing = typer.Argument(show_default=False)


def main() -> NoReturn:
    """Run the command line: 0 done, 1 a limit failed, 2 bad input in one clear line."""
    try:
        code = app(standalone_mode=False)
        sys.stdout.flush()
        if code == INTERRUPTED:
            raise KeyboardInterrupt
    except (BrokenPipeError, SystemExit):
        # Who read the output has gone, as `head` does. Rich and Typer would exit with 1 for it,
        # which here says that a limit failed; nothing else exits by itself.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        code = BROKEN_PIPE
    except TrigpointError as error:
        code = _fail(error.code, str(error))
    except (KeyboardInterrupt, typer.Abort):
        code = _fail("stopped", "Stopped; nothing half-written is left.")
    except OSError as error:
        where = f": {error.filename}" if error.filename else ""
        code = _fail("file", f"{error.strerror or error}{where}")
    except Exception as error:
        # Typer's usage errors share no public class across its versions, but all have this.
        usage = getattr(error, "format_message", None)
        if usage is None:
            raise
        code = _fail("usage", usage() or str(error))
    sys.exit(code or 0)


@app.callback(invoke_without_command=True)
def _without_command(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and stop.")] = False,
) -> None:
    if version:
        typer.echo(f"trigpoint {trigpoint.__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help(), err=True)
        raise typer.Exit(2)


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Where the project and its audit go.")] = Path("demo"),
    as_json: AsJson = False,
) -> None:
    """Make the clock-tower project and run its whole audit."""
    from trigpoint.synthetic import clock_tower, write_project

    with _progress() as say:
        say("building the clock tower and its three sensors")
        project = write_project(out, clock_tower())
    raise typer.Exit(_audit([project], None, as_json))


@app.command()
def new(folder: Annotated[Path, Existing], as_json: AsJson = False) -> None:
    """Lay out a project.

    A commented project.toml and an empty picks.csv, with where things go.
    """
    written = [str(path) for path in start_project(folder)]
    if as_json:
        _print_json({"written": written})
    else:
        typer.echo("\n".join(written))


@app.command()
def info(file: Annotated[Path, Existing], crs: Crs = "", as_json: AsJson = False) -> None:
    """Say what a cloud or pick file is.

    Points, extent, CRS, units, attributes, and what is doubtful.
    """
    results = plain(inspect(file, crs=crs or None))
    if as_json:
        _print_json(results)
    else:
        people.show_info(_people(), results)


@app.command()
def align(
    picks: Annotated[Path, Existing],
    repeat: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="PATH",
            help="The same places picked again, which gives the sigmas; may be repeated.",
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write the similarity here.")] = None,
    method: Annotated[
        Method, typer.Option(help="How picks that agree are found; all: no consensus.")
    ] = "ransac",
    threshold: Annotated[float, typer.Option(help="Inlier threshold in metres.")] = 0.50,
    trials: Annotated[
        int, typer.Option(min=1, help="Sets of three picks drawn by ransac.")
    ] = 10_000,
    seed: Annotated[int, typer.Option(min=0, help="Of the draws.")] = 42,
    weighted: Annotated[
        bool, typer.Option("--weighted", help="Weight by the picks' sigmas.")
    ] = False,
    crs: Crs = "",
    as_json: AsJson = False,
) -> None:
    """Fit one similarity to picks alone.

    With residuals, leave-one-out and reliability.
    """
    _refuse_overwriting(out, picks, *(repeat or []))
    used, repeats = trigpoint.read_picks(picks, crs=parse_crs(crs)), None
    if repeat:
        again = [trigpoint.read_picks(path, crs=parse_crs(crs)) for path in repeat]
        used, repeats = repicked(used, again)
    alignment = fit_picks(
        used,
        method=method,
        threshold=threshold,
        trials=trials,
        seed=seed,
        weighted=weighted,
    )
    results = plain(alignment_results(alignment, repeats=repeats))
    results["alignment"]["crs"] = crs or None
    if out is not None:
        write_text(out, to_json(results["alignment"]))
    if as_json:
        _print_json(results)
    else:
        people.show_alignment(_people(), results)
        people.show_warnings(_people(), results["warnings"])


@app.command()
def compare(
    reconstruction: Annotated[Path, Existing],
    reference: Annotated[Path, Existing],
    voxel: Annotated[
        float, typer.Option(min=0, help="Voxel size in metres; 0: no thinning.")
    ] = 0.10,
    within: Annotated[
        list[float] | None,
        typer.Option(
            metavar="METRES", help="A distance; may be repeated. By default 0.05, 0.10, 0.20."
        ),
    ] = None,
    zones: Annotated[str, typer.Option(help="Cuts of the reference's height range.")] = "0.33,0.66",
    margin: Annotated[
        str, typer.Option(help="Metres around the reference that count; none: no crop.")
    ] = "1.0",
    icp: Annotated[bool, typer.Option("--icp", help="Refine the pose by rigid ICP first.")] = False,
    crs: Crs = "",
    as_json: AsJson = False,
) -> None:
    """Measure a georeferenced cloud against a reference.

    Accuracy one way, completeness the other, by height zone.
    """
    cuts = tuple(_number(text, "--zones") for text in zones.split(","))
    padding = None if margin == "none" else _number(margin, "--margin")
    with _progress() as say:
        say(f"reading {reference.name}")
        target = prepare(reference, crs=crs or None, voxel=voxel, zones=cuts, margin=padding)
        say(f"reading {reconstruction.name}")
        source = thin(reconstruction, target, crs=crs or None)
        if not source.points_in_region:
            raise RegionError(_apart(reconstruction, target, margin, crs))
        trial = None
        if icp:
            say("refining by ICP")
            trial = try_icp(source, Surface(target.cloud.coordinates))
            source = source.moved(trial.refinement.similarity)
        say("measuring accuracy and completeness")
        comparison = measure(source, target, within=within or WITHIN_M)
    cautions = (*comparison.cautions, *(trial.cautions if trial else ()))
    results = plain(
        comparison_results(comparison)
        | {"icp": trial_results(trial), "warnings": warning_results(cautions)}
    )
    if as_json:
        _print_json(results)
    else:
        people.show_icp(_people(), {"alignment": None, "checks": None, "icp": results["icp"]})
        people.show_comparison(_people(), results, title=" after ICP" if icp else "")
        people.show_warnings(_people(), results["warnings"])


@app.command()
def apply(
    similarity: Annotated[Path, Existing],
    source: Annotated[Path, Existing],
    target: Annotated[Path, Existing],
    inverse: Annotated[bool, typer.Option("--inverse", help="Carry it back.")] = False,
    sigma: Annotated[
        bool,
        typer.Option(
            "--sigma",
            help="Give each point sigma_e, sigma_n, sigma_h in metres: of the whole output of "
            "align --json, which has the covariance.",
        ),
    ] = False,
    crs: Crs = "",
    as_json: AsJson = False,
) -> None:
    """Carry a cloud into the frame.

    Every attribute is kept, normals are turned, faces carried.
    """
    if sigma and inverse:
        message = "--sigma is of georeferenced points: it can't go with --inverse."
        raise SettingError(message)
    _refuse_overwriting(target, source, similarity)
    fit, stated_crs = read_similarity(similarity)
    sigmas = read_sigma(similarity) if sigma else None
    with _progress() as say:
        say(f"carrying {source.name} to {target.name}")
        points, cautions = carry(
            source,
            target,
            fit.inverse() if inverse else fit,
            crs=crs or (None if inverse else stated_crs),
            sigma=sigmas,
        )
    warnings = warning_results(cautions)
    if as_json:
        _print_json({"points": points, "path": str(target), "warnings": warnings})
    else:
        _people().print(f"{points:,} points written to {target}", markup=False)
        people.show_warnings(_people(), warnings)


@app.command()
def audit(
    projects: Annotated[
        list[Path],
        typer.Argument(
            show_default=False, metavar="PROJECT", help="A project.toml, or its folder."
        ),
    ],
    out: Annotated[Path | None, typer.Option(help="Folder of the bundles.")] = None,
    as_json: AsJson = False,
) -> None:
    """Run whole projects, each ending in a bundle with its report.

    Exit code 0: no limit is missed. 1: one is. 2: it could not be done.
    """
    raise typer.Exit(_audit(projects, out, as_json))


@app.command()
def verify(
    bundle: Annotated[Path, typer.Argument(show_default=False, help="A folder or a zip.")],
    inputs: Annotated[Path | None, typer.Option(help="Folder of the files audited.")] = None,
    again: Annotated[bool, typer.Option("--again", help="Run the audit again from them.")] = False,
    as_json: AsJson = False,
) -> None:
    """Verify a bundle: recompute, compare, name what differs.

    Exit code 0: everything holds. 1: something differs. 2: it could not be done.
    """
    with _progress() as say:
        found = verify_bundle(bundle, inputs=inputs, again=again, say=say)
    if as_json:
        _print_json(found.results())
    else:
        typer.echo(found.text(), nl=False)
    raise typer.Exit(0 if found.holds else 1)


def _audit(paths: list[Path], out: Path | None, as_json: bool) -> int:
    # All are read before the first is run: nobody waits to be told of a typing error, or of a
    # folder that can't be written.
    projects = []
    for path in paths:
        with _of_several(path, paths):
            projects.append(trigpoint.read_project(path))
    check_places(projects, out)
    done = []
    for path, project in zip(paths, projects, strict=True):
        with _progress() as say, _of_several(path, paths):
            found = deliver(project, out, say=say)
        done.append(found)
        if not as_json:
            page = found.folder / "report.html"
            people.show_audit(_people(), found.results, page if page.is_file() else found.folder)
        people.show_warnings(Console(stderr=True), warning_results(found.cautions))
    folders = [found.folder for found in done]
    if len(folders) > 1 and len({folder.parent for folder in folders}) == 1:
        write_index(folders[0].parent / "index.html", folders)
    if as_json:
        told = [
            {"path": str(found.folder), "zip": str(found.archive), "results": found.results}
            for found in done
        ]
        _print_json({"audits": told})
    return 1 if any(found.results["verdict"] == "FAIL" for found in done) else 0


@contextmanager
def _of_several(path: Path, paths: list[Path]) -> Iterator[None]:
    """Say of which project an error is, where there are several."""
    try:
        yield
    except TrigpointError as error:
        if len(paths) > 1:
            error.args = (f"{path}: {error}",)
        raise


def _refuse_overwriting(written: Path | None, *read: Path) -> None:
    for path in read:
        if written is not None and written.exists() and path.exists() and written.samefile(path):
            message = f"{written} is read: it would be overwritten. Name another file to write."
            raise SettingError(message)


def _apart(reconstruction: Path, target: Reference, margin: str, crs: str) -> str:
    """Say how a reconstruction misses its reference altogether: nothing can be measured."""
    info = trigpoint.describe(reconstruction, crs=crs or None)
    own, other = (
        " x ".join(f"{low:,.1f} to {high:,.1f}" for low, high in zip(*each, strict=True))
        for each in ((info.low, info.high), (target.low, target.high))
    )
    return (
        f"None of the {info.points:,} points of {reconstruction.name} lies within {margin} m of "
        f"the reference's extent: they span {own}, the reference {other}. Carry it into the "
        "reference's frame first (align, apply), or take a larger --margin."
    )


def _number(text: str, option: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        message = f"{option} holds {text!r}; it must be a number."
        raise RegionError(message) from error


def _people() -> Console:
    # Wide enough for the tables where there is no terminal to ask: a log, a pipe.
    stated = sys.stdout.isatty() or "COLUMNS" in os.environ
    return Console(width=None if stated else 160, highlight=False, emoji=False)


@contextmanager
def _progress() -> Iterator[people.Say]:
    """Show steps on standard error: a spinner on a terminal, plain lines elsewhere."""
    console = Console(stderr=True, highlight=False, emoji=False)
    if console.is_terminal:
        with console.status("starting") as status:
            yield status.update
    else:
        yield lambda step: console.print(step, markup=False)


def _print_json(results: Any) -> None:
    sys.stdout.write(to_json(results))


def _fail(code: str, message: str) -> int:
    line = " ".join(message.split())
    if "--json" in sys.argv:
        _print_json({"error": {"code": code, "message": line}})
    else:
        typer.echo(f"trigpoint: {line}", err=True)
    return 2
