"""What the picks and the similarity are worth, one figure for each question about them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray

from trigpoint.geometry import axis_words, rotation_axes
from trigpoint_reporting.blocks import Passage, Picture
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import number_text
from trigpoint_reporting.style import (
    BLACK,
    BLUE,
    GREY,
    PALE,
    VERMILLION,
    canvas,
    labels,
    listed,
    metres,
    no_picks,
    not_drawn,
    numbered,
    percent,
    pick_labels,
    rule,
    to_svg,
)
from trigpoint_reporting.wording import folds_of_icp, held_out_of_icp

# Rows of a figure with a row for every pick; a table lists the others.
ROWS = 40
Drawing = Picture | Passage


def leave_one_out_errors(evidence: Evidence, name: str) -> Drawing:
    """Draw each pick's error when it is left out, beside its residual in the fit."""
    found = evidence.results["reconstructions"][name]
    if found["alignment"] is None:
        return no_picks(name)
    loocv = found["loocv"]
    folds = _known(evidence, name, loocv["folds"], "d_m")
    if not len(folds):
        return not_drawn("Leave-one-out", f"{_count(found)} picks leave too few to refit")
    fit = {row["id"]: row["d_m"] for row in found["alignment"]["residuals"]}
    folds = folds.assign(fit_m=folds["id"].map(fit))
    shown, part = _largest(folds, "d_m")
    with canvas(_rows_mm(len(shown)) + 14) as figure:
        axes = figure.subplots()
        at = np.arange(len(shown))
        axes.barh(at, shown["d_m"], 0.62, color=PALE, edgecolor=GREY, label="left out")
        axes.plot(shown["fit_m"], at, "D", color=BLUE, label="in the fit", linestyle="none")
        _row_axis(axes, shown["label"], "pick")
        rule(axes, loocv["rmse_m"], f"leave-one-out RMSE {metres(loocv['rmse_m'])}")
        rmse = found["alignment"]["rmse_m"]
        rule(axes, rmse, f"fit RMSE {metres(rmse)}", color=BLUE, linestyle="dotted")
        axes.set_xlim(left=0)
        axes.set_xlabel("3D error at the pick, metres")
        axes.grid(True, axis="x")
        figure.legend(loc="outside lower center", ncols=4)
        content = to_svg(figure)
    worst = _worst(folds, "d_m")
    alt = (
        f"Left out in turn, the picks are predicted with {metres(loocv['rmse_m'])} RMSE; the fit "
        f"leaves {metres(rmse)}. The worst, {worst['label']}, is off by {metres(worst['d_m'])} "
        f"against {metres(worst['fit_m'])} in the fit."
    )
    caption = f"{name}: 3D error of each pick predicted from the others, and in the fit.{part}"
    return Picture(f"leave-one-out-{name}", caption, alt, content, "svg")


def scale_sensitivity(evidence: Evidence, name: str) -> Drawing:
    """Draw how far the scale moves when each pick is left out, and the limit if there is one."""
    found = evidence.results["reconstructions"][name]
    if found["alignment"] is None:
        return no_picks(name)
    folds = _known(evidence, name, found["loocv"]["folds"], "scale_change_pct")
    if not len(folds):
        return not_drawn("Scale sensitivity", f"{_count(found)} picks leave too few to refit")
    folds = folds.assign(size=folds["scale_change_pct"].abs())
    shown, part = _largest(folds, "size")
    limit = _limit(evidence, name, "loocv.max_scale_change_pct")
    scale, reliability = found["alignment"]["scale"], found["reliability"]
    with canvas(_rows_mm(len(shown)) + 22) as figure:
        axes = figure.subplots()
        at, change = np.arange(len(shown)), shown["scale_change_pct"].to_numpy()
        low, high = reliability["scale_low"], reliability["scale_high"]
        reach = 1.25 * max(float(np.abs(change).max()), limit or 0.0, 1e-6)
        interval = ""
        if low is not None:
            ends = [100 * (value / scale - 1) for value in (low, high)]
            first, last = number_text(low, 6), number_text(high, 6)
            interval = (
                f" The 95 % interval of the scale, {first} to {last}, is {_signed(ends[0])} to "
                f"{_signed(ends[1])} %."
            )
            if max(map(abs, ends)) <= 1.15 * reach:
                axes.axvspan(*ends, color="#EFEFEF", zorder=0, label="95 % interval of the scale")
        axes.hlines(at, 0, change, color=GREY, linewidth=0.8)
        axes.plot(change, at, "o", color=BLUE, label="scale without the pick", zorder=3)
        for row, value in zip(at, change, strict=True):
            axes.annotate(
                _signed(value),
                (value, row),
                (6 if value >= 0 else -6, 0),
                va="center",
                textcoords="offset points",
                ha="left" if value >= 0 else "right",
                fontsize=7,
            )
        rule(axes, 0.0, f"all picks: {number_text(scale, 6)}", linestyle="solid")
        if limit is not None:
            rule(axes, limit, f"limit ±{limit:g} %", color=VERMILLION)
            axes.axvline(-limit, color=VERMILLION, linestyle="dashed", linewidth=1.0)
        _row_axis(axes, shown["label"], "pick left out")
        axes.set_xlim(-1.15 * reach, 1.15 * reach)
        axes.set_xlabel("change of scale, %")
        axes.grid(True, axis="x")
        # What a change of scale does to a length, which a percentage leaves to mental arithmetic.
        above = axes.secondary_xaxis("top", functions=(_millimetres, _percentage))
        above.set_xlabel("the same, in millimetres over 10 m")
        figure.legend(loc="outside lower center", ncols=4)
        content = to_svg(figure)
    worst = _worst(folds, "size")
    judged = ""
    if limit is not None:
        within = float(worst["size"]) <= limit
        judged = f", {'within' if within else 'beyond'} the limit of {limit:g} %"
    alt = (
        f"No omitted pick changes the scale by more than {percent(worst['size'], 3)} "
        f"({worst['label']}){judged}."
    )
    caption = (
        f"{name}: scale sensitivity. Each dot is the scale refitted without one pick, against the "
        f"scale from all of them.{interval}{part}"
    )
    return Picture(f"scale-sensitivity-{name}", caption, alt, content, "svg")


def pick_reliability(evidence: Evidence, name: str) -> Drawing:
    """Draw how well each pick is checked by the others, and what error would go unseen in it."""
    found = evidence.results["reconstructions"][name]
    if found["alignment"] is None:
        return no_picks(name)
    table = _known(evidence, name, found["reliability"]["picks"], "redundancy")
    if not len(table):
        return not_drawn("Reliability", f"{_count(found)} picks leave no redundancy to judge by")
    fit = {row["id"]: row["d_m"] for row in found["alignment"]["residuals"]}
    table = table.assign(fit_m=table["id"].map(fit))
    shown, part = _largest(table, "detectable_blunder_m")
    at = np.arange(len(shown))
    suspected = shown["suspected"].eq(True).to_numpy()
    with canvas(_rows_mm(len(shown)) + 18) as figure:
        left, right = figure.subplots(1, 2, sharey=True)
        left.barh(at, shown["redundancy"], 0.62, color=PALE, edgecolor=GREY)
        left.set_xlim(0, 3)
        left.set_title("Redundancy, of 3")
        left.set_xlabel("share of the pick that the others check")
        _row_axis(left, shown["label"], "pick")
        right.plot(shown["detectable_blunder_m"], at, "o", color=BLACK, label="detectable blunder")
        right.plot(shown["fit_m"], at, "D", color=BLUE, label="residual")
        if suspected.any():
            right.plot(
                shown["fit_m"][suspected],
                at[suspected],
                "s",
                markersize=10,
                fillstyle="none",
                color=VERMILLION,
                label="suspected",
            )
        right.set_xlim(left=0)
        right.set_title("Detectable blunder")
        right.set_xlabel("metres")
        for axes in (left, right):
            axes.grid(True, axis="x")
        figure.legend(loc="outside lower center", ncols=3)
        content = to_svg(figure)
    blunder = table.dropna(subset=["detectable_blunder_m"])
    named = table["label"][table["suspected"].eq(True)].tolist()
    unseen = "no blunder size can be stated"
    if len(blunder):
        hard = _worst(blunder, "detectable_blunder_m")
        easy = _worst(blunder.assign(ease=-blunder["detectable_blunder_m"]), "ease")
        unseen = (
            f"a blunder below {metres(hard['detectable_blunder_m'])} at {hard['label']} may go "
            f"unseen, below {metres(easy['detectable_blunder_m'])} at {easy['label']}"
        )
    alt = (
        f"Redundancy runs from {table['redundancy'].min():.2f} to {table['redundancy'].max():.2f} "
        f"of 3; {unseen}. " + (f"Suspected: {listed(named)}." if named else "No pick is suspected.")
    )
    caption = (
        f"{name}: how well each pick is checked by the others, and the smallest blunder that the "
        f"outlier test would find (alpha 0.001, power 0.80).{part}"
    )
    return Picture(f"reliability-{name}", caption, alt, content, "svg")


def pose_uncertainty(evidence: Evidence, name: str) -> Drawing:
    """Draw the sigma of the rotation about its principal axes, and of a point in each zone."""
    found = evidence.results["reconstructions"][name]
    if found["alignment"] is None:
        return no_picks(name)
    turns = found["reliability"]["rotation_sigma_deg"]
    zones = {k: v["sigma_m"] for k, v in found["reliability"]["zones"].items()}
    known = {zone: sigma for zone, sigma in zones.items() if sigma is not None}
    if None in turns or not known:
        return not_drawn("The similarity's sigma", f"{_count(found)} picks leave none to estimate")
    rotation = np.array(found["reliability"]["covariance"])[1:4, 1:4]
    weakest = axis_words(rotation_axes(rotation)[1][0])
    with canvas(44) as figure:
        left, right = figure.subplots(1, 2)
        _named_bars(left, ["weakest", "next", "strongest"], turns, "{:.3f}°")
        left.set_title("Rotation about its own axes")
        left.set_xlabel("sigma, degrees")
        _named_bars(right, labels(list(known)), list(known.values()), "{:.3f} m")
        right.set_title("A point carried by the similarity")
        right.set_xlabel("3D sigma, RMS over the zone, metres")
        content = to_svg(figure)
    least, most = min(known, key=known.__getitem__), max(known, key=known.__getitem__)
    alt = (
        f"The rotation is least certain about {weakest}, sigma {turns[0]:.3f} degrees. "
        f"Picking alone moves a point by "
        f"{metres(known[most])} in the {most} zone and {metres(known[least])} in the {least} zone."
    )
    caption = (
        f"{name}: what the picks leave uncertain in the similarity (one sigma). The rotation is "
        f"weakest about {weakest}."
    )
    return Picture(f"pose-uncertainty-{name}", caption, alt, content, "svg")


def icp_before_after(evidence: Evidence, name: str) -> Drawing:
    """Draw every error that ICP was tested by, before it and after it."""
    found = evidence.results["reconstructions"][name]
    icp = found["icp"]
    if icp is None:
        return not_drawn("ICP", "the project does not ask for it")
    tests = [
        (label, icp[f"{key}_rmse_before_m"], icp[f"{key}_rmse_after_m"])
        for label, key in (
            ("check picks", "check"),
            (_left_out(found), "loocv"),
            ("control picks", "control"),
            ("surface", "surface"),
        )
        if icp[f"{key}_rmse_before_m"] is not None and icp[f"{key}_rmse_after_m"] is not None
    ]
    if not tests:
        return not_drawn("ICP", "nothing overlaps to be measured")
    if len(tests) == 1:
        return not_drawn("Errors without and with ICP", "the table has the only one")
    names, before, after = zip(*tests, strict=True)
    with canvas(20 + 9 * len(tests)) as figure:
        axes = figure.subplots()
        at = np.arange(len(tests))
        for row, (_, start, end) in enumerate(tests):
            axes.annotate(
                "",
                (end, row),
                (start, row),
                arrowprops={"arrowstyle": "->", "color": GREY, "shrinkA": 4, "shrinkB": 4},
            )
            change = f"{1000 * (end - start):+.0f} mm".replace("-", "\N{MINUS SIGN}")
            axes.annotate(
                change,
                (max(start, end), row),
                (9, 0),
                textcoords="offset points",
                va="center",
                color=VERMILLION if end > start else BLACK,
                fontsize=7.5,
            )
        axes.plot(before, at, "o", color=BLUE, label="before ICP")
        axes.plot(after, at, "s", color=VERMILLION, fillstyle="none", label="after ICP")
        _row_axis(axes, names, "")
        axes.set_xlim(0, 1.15 * max(*before, *after))
        axes.set_xlabel("RMSE, metres")
        axes.grid(True, axis="x")
        figure.legend(loc="outside lower center", ncols=2)
        content = to_svg(figure)
    moves = [
        f"{'rises' if end > start else 'falls'} from {metres(start)} to {metres(end)} ({label})"
        for label, start, end in tests
    ]
    verdict = "meets the rule and is not delivered" if icp["retained"] else "is not retained"
    asked = held_out_of_icp(found)
    doubt = ""
    if asked is not None and not asked.shows:
        doubt = (
            f" {asked.n} picks know their RMSE to about {metres(asked.known_to_m)}, and the change "
            "is smaller."
        )
    alt = f"ICP {verdict}: the RMSE {listed(moves)}.{doubt}"
    caption = (
        f"{name}: ICP as a hypothesis, which {verdict}. It minimises the surface's RMSE, and the "
        "fit has minimised the control picks': only what is held out decides."
    )
    return Picture(f"icp-{name}", caption, alt, content, "svg")


def _left_out(found: dict[str, Any]) -> str:
    folds, given = folds_of_icp(found), _count(found) if found["alignment"] else 0
    return "leave-one-out" if folds == given else f"leave-one-out,\n{folds} of {given:,} picks"


def _largest(table: pd.DataFrame, column: str) -> tuple[pd.DataFrame, str]:
    """Keep the rows a figure can show, in their order, and say so where some are left out."""
    if len(table) <= ROWS:
        return table, numbered(table["label"])
    kept = table.loc[table[column].nlargest(ROWS).index.sort_values()]
    return kept, f" The {ROWS} largest of {len(table)} are shown.{numbered(kept['label'])}"


def _known(evidence: Evidence, name: str, rows: list[dict[str, Any]], column: str) -> pd.DataFrame:
    """Return the rows in which a column is not null, with a label for each."""
    table = pd.DataFrame(rows)
    if not len(table):
        return table
    label = table["id"].map(pick_labels(evidence, name))
    return table.assign(label=label).dropna(subset=[column])


def _worst(table: pd.DataFrame, column: str) -> dict[str, Any]:
    row = table.iloc[int(np.argmax(table[column].to_numpy(np.float64)))]
    return {str(key): value for key, value in row.items()}


def _millimetres(percentage: ArrayLike) -> NDArray[np.float64]:
    """Turn a change of scale into what it does to 10 m."""
    return 100 * np.asarray(percentage, np.float64)


def _percentage(millimetres: ArrayLike) -> NDArray[np.float64]:
    return np.asarray(millimetres, np.float64) / 100


def _row_axis(axes: Axes, names: Sequence[str] | pd.Series, title: str) -> None:
    axes.set_yticks(range(len(names)), list(names))
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set_ylabel(title)
    axes.tick_params(axis="y", length=0)


def _named_bars(axes: Axes, names: Sequence[str], values: Sequence[float], text: str) -> None:
    bars = axes.barh(range(len(values)), values, 0.6, color=PALE, edgecolor=GREY)
    axes.bar_label(bars, [text.format(value) for value in values], padding=3, fontsize=7.5)
    _row_axis(axes, names, "")
    axes.set_xlim(0, 1.25 * max(*values, 1e-9))


def _rows_mm(rows: int) -> float:
    return 14 + 5.0 * max(rows, 3)


def _limit(evidence: Evidence, name: str, quantity: str) -> float | None:
    for row in evidence.results["criteria"]:
        if (row["quantity"], row["of"]) == (quantity, name) and row["limit"].startswith("max "):
            return float(row["limit"].removeprefix("max "))
    return None


def _signed(value: float) -> str:
    text = number_text(value, 3)
    return text if value < 0 else f"+{text}"


def _count(found: dict[str, Any]) -> int:
    return int(found["alignment"]["n"])
