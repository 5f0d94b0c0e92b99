"""Results as tables for a person at a terminal: the same numbers as results.json, rounded."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from trigpoint_reporting.terminal import show_pairs, show_table
from trigpoint_reporting.wording import verdict_of_icp

Results = Mapping[str, Any]
Say = Callable[[str], None]

# More picks than a person reads on a terminal: of these the worst are shown.
MANY, WORST = 50, 20


def number(value: float | None, digits: int = 3) -> str:
    """Format a number; a missing one is a dash."""
    return "-" if value is None else f"{value:z.{digits}f}"


def length(value: float | None) -> str:
    """Format a number of metres; a missing one is not available."""
    return "not available" if value is None else f"{value:.3f} m"


def show_alignment(console: Console, results: Results, *, name: str = "") -> None:
    """Print a similarity, its residuals, leave-one-out, reliability and check picks.

    Of many picks those with the largest residuals are printed. `name` is of a reconstruction in
    a bundle, whose tables hold them all.
    """
    alignment, loocv = results["alignment"], results["loocv"]
    of = f" of {name}" if name else ""
    trials = f"{alignment['trials']:,}"
    consensus = {
        "ransac": ("RANSAC", f"{trials} samples, seed {alignment['seed']}"),
        "exhaustive": ("exhaustive", f"all {trials} minimal sets"),
        "all": ("none", "all picks are used"),
    }[alignment["method"]]
    agrees = {
        True: "; trying every minimal set agrees",
        False: "; trying every minimal set DISAGREES",
        None: "",
    }[alignment["exhaustive_agrees"]]
    reliability = results["reliability"]
    low, high, interval = reliability["scale_low"], reliability["scale_high"], ""
    if low is not None:
        half = 1e6 * (high - low) / 2 / alignment["scale"]
        interval = f"{low:.6f} to {high:.6f}, ±{half:,.0f} ppm"
    rows = [
        ("scale", f"{alignment['scale']:.6f}", f"95 %: {interval}" if interval else ""),
        (
            "fit RMSE",
            length(alignment["rmse_m"]),
            f"over {alignment['n']} of {len(alignment['residuals'])} control picks; "
            f"{length(alignment['rmse_dof_m'])} by {alignment['dof']} degrees of freedom",
        ),
        *_held_out(loocv),
        ("sigma of a coordinate", length(reliability["sigma0_m"]), _range(reliability, "sigma0")),
        *_sigmas(reliability),
        ("geometry", reliability["geometry"], ""),
        ("consensus", consensus[0], consensus[1] + agrees),
    ]
    show_pairs(console, f"Similarity{of}", rows)

    folds = {fold["id"]: fold for fold in loocv["folds"]}
    picks = {pick["id"]: pick for pick in reliability["picks"]}
    lines = []
    residuals, left_out = _worst(alignment["residuals"], name and f"picks-{name}")
    for residual in residuals:
        fold, pick = folds.get(residual["id"], {}), picks.get(residual["id"], {})
        lines.append(
            (
                residual["id"],
                "yes" if residual["used"] else "REJECTED",
                *(number(residual[key]) for key in ("dx_m", "dy_m", "dz_m", "d_m")),
                number(fold.get("d_m")),
                number(fold.get("scale_change_pct"), 3),
                number(pick.get("redundancy"), 2),
                number(pick.get("detectable_blunder_m"), 2),
                "-" if pick.get("p_value") is None else f"{pick['p_value']:.3f}",
                "SUSPECT" if pick.get("suspected") else "",
            )
        )
    show_table(
        console,
        f"Control picks{of}: residuals are target - transformed source",
        (
            "pick",
            "used",
            "dE m",
            "dN m",
            "dh m",
            "3D m",
            "left out m",
            "scale %",
            "redund.",
            "detectable m",
            "p",
            "",
        ),
        lines,
        note=left_out + reliability["statement"],
    )
    checks = results["checks"]
    if checks["n"]:
        residuals, left_out = _worst(checks["residuals"], name and f"checks-{name}")
        show_table(
            console,
            f"Check picks{of}: they enter nothing",
            ("pick", "dE m", "dN m", "dh m", "3D m"),
            [
                (row["id"], *(number(row[key]) for key in ("dx_m", "dy_m", "dz_m", "d_m")))
                for row in residuals
            ],
            note=left_out + _check_note(checks),
        )


def _worst(residuals: Sequence[Results], table: str) -> tuple[Sequence[Results], str]:
    """Return the rows to print, largest residual first where not all are, and what to say then."""
    if len(residuals) <= MANY:
        return residuals, ""
    worst = sorted(residuals, key=lambda row: -row["d_m"])[:WORST]
    more, whole = len(residuals) - WORST, f"data/{table}.csv" if table else "--json"
    return worst, f"The {WORST} largest residuals; {more:,} picks more are in {whole}. "


def _held_out(loocv: Results) -> Iterator[tuple[str, str, str]]:
    """Say how far picks are missed that the fit has not seen."""
    if loocv["rmse_m"] is None:
        yield "leave-one-out RMSE", "not available", ""
        return
    redone = f"{length(loocv['rmse_procedure_m'])} with the consensus redone in each fold"
    yield "leave-one-out RMSE", length(loocv["rmse_m"]), redone
    change = f"{loocv['max_scale_change_pct']:.3f} %"
    yield "largest scale change", change, "when one pick is left out"


def _range(found: Results, name: str) -> str:
    low, high = found[f"{name}_low_m"], found[f"{name}_high_m"]
    return "" if low is None or high is None else f"95 %: {low:.3f} to {high:.3f} m"


def _check_note(checks: Results) -> str:
    mean = ", ".join(f"{each:+.3f}" for each in checks["mean_m"])
    total = checks["total_m"]
    whole = "" if total is None else f"; {total:.3f} m with the reference's own accuracy added"
    return (
        f"RMSE {length(checks['rmse_m'])} over {checks['n']} check picks, mean error {mean} m "
        f"(E, N, h){whole}."
    )


def _sigmas(reliability: Results) -> Iterator[tuple[str, str, str]]:
    """Say what the similarity's uncertainty rests on and comes to."""
    if reliability["noise"] == "stated":
        p = reliability["global_p_value"]
        fits = f"as the picks state; chi-square test of the residuals p {p:.3f}"
        yield "sigma used", length(reliability["sigma_m"]), fits
    else:
        yield "sigma used", length(reliability["sigma_m"]), "from the residuals"
    for found in reliability["repeats"]:
        unit = "m" if found["frame"] == "target" else "units"
        yield (
            f"repeated in the {found['frame']}",
            f"{found['sigma']:.4g} {unit}",
            f"95 %: {found['sigma_low']:.4g} to {found['sigma_high']:.4g} {unit}; "
            f"{found['places']} places, {found['sessions']} times",
        )
    turned = reliability["rotation_sigma_deg"]
    if None not in turned:
        degrees = ", ".join(f"{each:.3f}" for each in turned)
        yield "sigma of rotation", f"{degrees} deg", "about its principal axes, worst first"
    covariance = reliability["covariance"]
    if covariance is not None and None not in covariance[4]:
        metres = ", ".join(f"{covariance[k][k] ** 0.5:.3f}" for k in (4, 5, 6))
        yield "sigma of position", f"{metres} m", "E, N, h at the picks' centroid"


def show_icp(console: Console, found: Results, *, name: str = "") -> None:
    """Print ICP as the hypothesis it is: what came of it as the report says it, then the numbers.

    With the name of a reconstruction it is of an audit, which delivers the cloud without it.
    """
    icp = found["icp"]
    if icp is None:
        return
    rows = []
    for label, key in (
        ("surface RMSE", "surface_rmse"),
        ("control RMSE", "control_rmse"),
        ("leave-one-out RMSE", "loocv_rmse"),
        ("check RMSE", "check_rmse"),
    ):
        before, after = icp[f"{key}_before_m"], icp[f"{key}_after_m"]
        if before is not None:
            rows.append((label, number(before), number(after)))
    show_table(
        console,
        f"Rigid ICP{' of ' + name if name else ''}: {verdict_of_icp(found).removesuffix('.')}",
        ("", "before m", "after m"),
        rows,
        note=f"{icp['rule']} It moved the centroid by {number(icp['shift_m'])} m and turned by "
        f"{icp['rotation_deg']:.4f} deg in {icp['iterations']} iterations, "
        f"{number(icp['overlap_pct'], 1)} % overlap." + (" It is not delivered." if name else ""),
    )


def show_comparison(console: Console, comparison: Results, *, title: str = "") -> None:
    """Print accuracy and completeness by zone, and what their intervals mean."""
    for direction, arrow in (
        ("accuracy", "reconstruction to reference"),
        ("completeness", "reference to reconstruction"),
    ):
        zones = comparison[direction]
        thresholds = [each["threshold_m"] for each in zones["all"]["within"]]
        rows = [
            (
                zone,
                f"{row['n']:,}",
                number(row["mean_m"]),
                number(row["median_m"]),
                number(row["rmse_m"]),
                number(row["p95_m"]),
                number(row["floor_rmse_m"]),
                *(_share(each) for each in row["within"]),
            )
            for zone, row in zones.items()
        ]
        show_table(
            console,
            f"{direction.capitalize()}{title}: {arrow}",
            (
                "zone",
                "n",
                "mean m",
                "median m",
                "RMSE m",
                "95 % m",
                "floor m",
                *(f"in {threshold:g} m %" for threshold in thresholds),
            ),
            rows,
        )
    intervals = comparison.get("intervals")
    if intervals is not None:
        stray = (
            " What was measured, in front of an interval, can lie outside it: noise in the pose "
            "makes most clouds look worse than they are."
        )
        console.print(
            Text(intervals["statement"] + (stray if _strays(comparison) else "")), style="dim"
        )
        console.print()


def _strays(comparison: Results) -> bool:
    """Say whether a measured share lies outside its own interval."""
    return any(
        share["low_pct"] is not None and not share["low_pct"] <= share["pct"] <= share["high_pct"]
        for direction in ("accuracy", "completeness")
        for row in comparison[direction].values()
        for share in row["within"]
    )


def _share(within: Results) -> str:
    share = number(within["pct"], 1)
    if within["low_pct"] is None:
        return share
    return f"{share} ({number(within['low_pct'], 1)}-{number(within['high_pct'], 1)})"


def show_warnings(console: Console, warnings: Sequence[Results]) -> None:
    """Print every caution with its code."""
    for warning in warnings:
        console.print(Text(f"! {warning['code']}: {warning['message']}"), style="yellow")


def show_info(console: Console, info: Results) -> None:
    """Print what a cloud or pick file is."""
    table = Table(box=None, show_header=False, pad_edge=False)
    for key, value in info.items():
        if key != "warnings" and value not in (None, [], ""):
            table.add_row(Text(key.replace("_", " "), style="bold"), Text(_told(value)))
    console.print(table)
    show_warnings(console, info["warnings"])


def show_audit(console: Console, results: Results, written: Path) -> None:
    """Print a whole audit: every reconstruction, the limits, the verdict, and where it lies."""
    for name, each in results["reconstructions"].items():
        if each["alignment"] is not None:
            show_alignment(console, each, name=name)
        show_icp(console, each, name=name)
        delivered, after = each["comparison"]["delivered"], each["comparison"]["after_icp"]
        show_comparison(console, delivered, title=f" of {name}, as delivered")
        if after is not None:
            show_comparison(console, after, title=f" of {name}, after ICP")
    for stage, told in (("delivered", "As delivered"), ("after_icp", "After ICP")):
        for pair in results["paired"][stage]:
            console.print(Text(f"{told}: {pair['statement']}"))
    if results["criteria"]:
        show_table(
            console,
            "Limits",
            ("quantity", "of", "limit", "found", "margin", "met"),
            [
                (
                    row["quantity"],
                    row["of"],
                    row["limit"],
                    number(row["found"]),
                    number(row["margin"]),
                    "yes" if row["met"] else "NO",
                )
                for row in results["criteria"]
            ],
        )
    show_warnings(console, results["warnings"])
    console.print(Text(f"Verdict: {results['verdict']}", style="bold"))
    console.print(Text(f"Result: {written}"))


def _told(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:,.3f}"
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_told(item)}" for key, item in value.items() if item is not None)
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(_told(item) for item in value)
    return str(value)
