"""LAS, LAZ and COPC, through laspy with lazrs."""

from __future__ import annotations

import datetime as dt
import struct
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import laspy
import lazrs
import numpy as np
import pyproj
from laspy.vlrs.known import WktCoordinateSystemVlr
from numpy.typing import NDArray
from pyproj.enums import WktVersion
from pyproj.exceptions import CRSError

from trigpoint.cautions import Caution
from trigpoint.crs import header_crs
from trigpoint.errors import CloudError
from trigpoint.formats.source import Attributes, Box, Chunk, Plan, Source, columns_of, cut_short

# What laspy and lazrs raise for a broken file.
FAULTS = (laspy.LaspyException, lazrs.LazrsError, OSError, ValueError, IndexError, KeyError)

# Steps of the coordinates written, in the file's units: a tenth of a millimetre on the ground, and
# finer where nothing says how long a unit is.
GROUND_STEP, LOCAL_STEP = 1e-4, 1e-5
# GPS time counted within a week ends here; anything beyond counts from 1980 or 2011.
WEEK_S = 604_800
# What lazrs says where a file ends too soon.
_ENDED = "failed to fill whole buffer"
_INT32 = np.iinfo(np.int32)
# The shortest records that describe a file, before its points and after them.
_VLR, _EVLR = 54, 60
_WKT_BIT = 16

_COORDINATES = frozenset({"X", "Y", "Z"})
# Pointers into waveforms, which are other files.
_WAVEFORM = frozenset(
    {*laspy.PointFormat(4).dimension_names} - {*laspy.PointFormat(1).dimension_names}
)
_COLOURS = frozenset({"red", "green", "blue", "nir"})

Values = NDArray[Any]


def opened(path: Path) -> Source:
    """Read the header."""
    _refuse_promises(path)
    with laspy.open(path) as reader:
        header = reader.header
    is_copc = any(vlr.user_id == "copc" for vlr in header.vlrs)
    extent = Box(np.array(header.mins, np.float64), np.array(header.maxs, np.float64))
    crs, cautions = header_crs(*_records(header), extent.low, extent.high)
    kind = "COPC" if is_copc else "LAZ" if header.are_points_compressed else "LAS"
    return Source(
        format=f"{kind} {header.version}, point format {header.point_format.id}",
        chunks=partial(_queried if is_copc else _streamed, path),
        attributes=_names(header),
        extent=extent if np.isfinite(extent).all() and header.point_count else None,
        points=header.point_count,
        step=np.array(header.scales, np.float64),
        crs=crs,
        cautions=cautions,
    )


def write(path: Path, chunks: Iterator[Chunk], plan: Plan) -> tuple[Caution, ...]:
    """Write LAS 1.4, compressed where the name ends in .laz.

    Point format 6, 7 (colour) or 8 (near infrared) holds the standard attributes, extra
    dimensions the others. Eight-bit colours are spread over the sixteen bits that LAS has, and
    scan angles in degrees become its steps of 0.006 degrees. The same points give the same bytes
    however they are chunked: no date of today, a scale and an offset that the first point settles.
    """
    first = next(chunks)
    pattern = _header(plan.like) if plan.like else None
    layout, dropped = _layout(_spread(first.attributes), pattern)
    header = laspy.LasHeader(version="1.4", point_format=_point_format(first.attributes))
    header.generating_software = header.system_identifier = "trigpoint"
    # laspy writes today for None.
    header.creation_date = (pattern and pattern.creation_date) or dt.date.min
    header.file_source_id = pattern.file_source_id if pattern else 0
    # Whole: bit by bit, laspy 2.5 flips what it should clear. Point formats 6 and above ask for
    # the WKT bit, CRS or none.
    header.global_encoding.value = _gps_time_type(first.attributes, pattern) | _WKT_BIT
    if plan.crs is not None:
        header.vlrs.append(WktCoordinateSystemVlr(_wkt(plan.crs)))
    header.offsets = np.floor(first.xyz[0])
    header.scales = np.full(3, _step(plan, header.offsets))
    header.add_extra_dims([slot.extra for slot in layout if slot.extra])
    for vlr in header.vlrs.get("ExtraBytesVlr"):
        for entry in vlr.extra_bytes_structs:
            # laspy takes the range of a dimension from the first point of each chunk: state none.
            # Raw bytes, type 0, count themselves where others have these flags.
            if entry.data_type:
                entry.options &= ~(entry.MIN_BIT_MASK | entry.MAX_BIT_MASK)

    compressed = path.suffix.lower() == ".laz"
    try:
        with (
            path.open("wb+") as file,
            laspy.open(
                file, mode="w", header=header, do_compress=compressed, closefd=False
            ) as writer,
        ):
            for chunk in chain([first], chunks):
                writer.write_points(_packed(chunk, header, layout))
    except lazrs.LazrsError as error:
        # It says that it could not write and not why; closing the file says why, where it still
        # has something to write.
        raise OSError(str(error)) from error
    coarse = header.scales[0] > (GROUND_STEP if plan.crs else LOCAL_STEP)
    return (*dropped, *([_coarse(header)] if coarse else []))


def _refuse_promises(path: Path) -> None:
    """Refuse a header that counts more records than its file holds.

    laspy would read every one of them, up to four thousand million, before it noticed.
    """
    with path.open("rb") as file:
        start = file.read(247)
    if len(start) < 104 or not start.startswith(b"LASF"):
        return  # laspy says so at once
    size = path.stat().st_size
    header, points, records = struct.unpack_from("<HLL", start, 94)
    end = header + _VLR * records
    if end > min(points, size):
        raise CloudError(_damaged(path, records, end, min(points, size)))
    if start[25] >= 4 and len(start) == 247:
        after, records = struct.unpack_from("<QL", start, 235)
        end = after + _EVLR * records
        if records and end > size:
            raise CloudError(_damaged(path, records, end, size))


def _damaged(path: Path, records: int, end: int, room: int) -> str:
    return (
        f"{path.name} is damaged: its header counts {records:,} records, which need {end:,} bytes "
        f"or more, and they have {room:,}. Copy or export it again."
    )


def _streamed(path: Path, size: int, attributes: bool, box: Box | None) -> Iterator[Chunk]:
    del box  # there is no index to use it with
    with laspy.open(path, decompression_selection=_selection(attributes)) as reader:
        header = reader.header
        if not header.are_points_compressed:
            held = (path.stat().st_size - header.offset_to_point_data) // header.point_format.size
            if held < header.point_count:
                message = cut_short(path, max(held, 0), header.point_count)
                raise CloudError(message)
        points = 0
        try:
            for record in reader.chunk_iterator(size):
                points += len(record)
                yield _chunk(record, attributes=attributes)
        except lazrs.LazrsError as error:
            if _ENDED not in str(error):
                raise
            # How many whole points are left, no one can tell who has not unpacked them.
            message = (
                f"{path.name} is cut short: it ends before the last of the "
                f"{header.point_count:,} points that its header promises. Copy or export it again."
            )
            raise CloudError(message) from error
        if points != header.point_count:
            message = cut_short(path, points, header.point_count)
            raise CloudError(message)


def _queried(path: Path, size: int, attributes: bool, box: Box | None) -> Iterator[Chunk]:
    if box is None:
        yield from _streamed(path, size, attributes, box)
        return
    with laspy.CopcReader.open(path, decompression_selection=_selection(attributes)) as reader:
        # Clipped, since laspy turns the bounds into 32-bit steps.
        low = np.maximum(box.low, reader.header.mins - reader.header.scales)
        high = np.minimum(box.high, reader.header.maxs + reader.header.scales)
        if (low > high).any():
            return
        record = reader.query(laspy.Bounds(mins=low, maxs=high))
        for start in range(0, len(record), size):
            yield _chunk(record[start : start + size], attributes=attributes)


def _chunk(record: Any, *, attributes: bool) -> Chunk:
    xyz = np.empty((len(record), 3))
    for axis, name in enumerate("XYZ"):
        # As the LAS specification has it, into place, with no array between.
        np.multiply(record[name], record.scales[axis], out=xyz[:, axis])
        xyz[:, axis] += record.offsets[axis]
    names = record.point_format.dimension_names if attributes else ()
    return Chunk(xyz, {name: np.array(record[name]) for name in names if name not in _COORDINATES})


def _selection(attributes: bool) -> laspy.DecompressionSelection:
    everything = laspy.DecompressionSelection.all()
    return everything if attributes else laspy.DecompressionSelection.base().decompress_z()


def _names(header: laspy.LasHeader) -> tuple[str, ...]:
    return tuple(n for n in header.point_format.dimension_names if n not in _COORDINATES)


def _header(path: Path) -> laspy.LasHeader:
    with laspy.open(path) as reader:
        return reader.header


def _records(header: laspy.LasHeader) -> tuple[str | None, Mapping[int, int] | None]:
    """WKT, and the GeoTIFF keys whose value stands in the directory."""
    wkt: str | None = None
    keys: dict[int, int] | None = None
    for vlr in [*header.vlrs, *(header.evlrs or [])]:
        if vlr.user_id == "LASF_Projection" and vlr.record_id == 2112:
            wkt = vlr.record_data_bytes().decode("utf-8", errors="replace")
        elif vlr.user_id == "LASF_Projection" and vlr.record_id == 34735:
            directory = np.frombuffer(vlr.record_data_bytes(), "<u2")
            entries = directory[4 : 4 * (len(directory) // 4)].reshape(-1, 4)
            keys = {int(e[0]): int(e[3]) for e in entries if e[0] and not e[1]}
    return wkt, keys


class _Slot(NamedTuple):
    """Where an attribute goes in a LAS point."""

    attribute: str
    dimension: str
    convert: Callable[[Values], Values]
    extra: laspy.ExtraBytesParams | None = None


def _layout(
    attributes: Attributes, pattern: laspy.LasHeader | None
) -> tuple[list[_Slot], list[Caution]]:
    names = laspy.PointFormat(_point_format(attributes)).dimension_names
    standard = set(names) - _COORDINATES
    scaled = {d.name: d for d in pattern.point_format.extra_dimensions} if pattern else {}
    slots: list[_Slot] = []
    dropped: list[Caution] = []
    for name, values in attributes.items():
        if reason := _unfit(name, values):
            dropped.append(Caution("attribute_dropped", f"LAS can't hold {name!r}: {reason}."))
        elif name == "scan_angle_rank":
            slots.append(_Slot(name, "scan_angle", lambda v: np.rint(v / 0.006)))
        elif name in _COLOURS & standard and values.dtype == np.uint8:
            slots.append(_Slot(name, name, lambda v: v.astype(np.uint16) * np.uint16(257)))
        elif name in standard and values.ndim == 1 and _is_whole(name, values):
            slots.append(_Slot(name, name, lambda v: v))
        else:
            # A standard name over fractions, such as an intensity from 0 to 1, keeps its values.
            free = f"{name}_value" if name in standard else name
            slots.append(_extra(name, free, values, scaled.get(name)))
    return slots, dropped


def _spread(attributes: Attributes) -> Attributes:
    """Put what is too wide for an extra dimension into several; LAS takes three, or any bytes."""
    wide = {
        name: values
        for name, values in attributes.items()
        if values.ndim == 2
        and (values.shape[1] == 1 or (values.shape[1] > 3 and values.dtype != np.uint8))
    }
    return {n: v for n, v in attributes.items() if n not in wide} | columns_of(wide)


def _unfit(name: str, values: Values) -> str:
    if name in _WAVEFORM:
        return "it points into waveforms, which are not carried"
    if values.dtype.kind not in "biuf" or values.ndim > 2:
        return "it is not a number, nor a row of numbers"
    if len(name.encode()) > 32:
        return "its name is longer than 32 bytes"
    return ""


def _is_whole(name: str, values: Values) -> bool:
    if name == "gps_time" or values.dtype.kind in "biu":
        return True
    # Scanners give intensity as a share of one: whole numbers at the beginning prove nothing.
    if name == "intensity" and values.dtype == np.float32:
        return False
    return bool((values == np.rint(values)).all())


def _extra(name: str, dimension: str, values: Values, like: Any) -> _Slot:
    dtype = np.dtype({"b1": "u1", "f2": "f4"}.get(values.dtype.str[1:], values.dtype.str[1:]))
    if values.ndim == 2:
        dtype = np.dtype((dtype, (values.shape[1],)))
    kept: dict[str, Any] = {}
    if like is not None:
        kept = {"description": like.description}
        # Unknown to laspy 2.5.
        if getattr(like, "no_data", None) is not None:
            kept["no_data"] = like.no_data
        if like.is_scaled:
            # Whole numbers under a scale: laspy hands out what they stand for.
            dtype = like.dtype
            kept |= {"offsets": like.offsets, "scales": like.scales}
    extra = laspy.ExtraBytesParams(dimension, dtype, **kept)
    return _Slot(name, dimension, lambda v: v, extra)


def _point_format(attributes: Attributes) -> int:
    if "nir" in attributes:
        return 8
    return 7 if {"red", "green", "blue"} <= set(attributes) else 6


def _gps_time_type(attributes: Attributes, pattern: laspy.LasHeader | None) -> int:
    if pattern:
        return int(pattern.global_encoding.gps_time_type)
    times = np.asarray(attributes.get("gps_time", 0.0), np.float64)
    return int(np.abs(times[:1] if times.ndim else times).max() > WEEK_S)


def _step(plan: Plan, offsets: NDArray[np.float64]) -> float:
    step = GROUND_STEP if plan.crs else LOCAL_STEP
    if plan.extent is None:
        return step
    reach = max(np.abs(end - offsets).max() for end in plan.extent)
    while reach / step > _INT32.max - 1:
        step *= 10
    return step


def _packed(chunk: Chunk, header: laspy.LasHeader, layout: list[_Slot]) -> Any:
    record = laspy.ScaleAwarePointRecord.zeros(len(chunk.xyz), header=header)
    steps = np.rint((chunk.xyz - header.offsets) / header.scales)
    if np.abs(steps).max(initial=0) > _INT32.max:
        reach = np.abs(chunk.xyz - header.offsets).max()
        message = (
            f"the points reach {reach:,.0f} units from the first one, and LAS in steps of "
            f"{header.scales[0]:g} reaches {_INT32.max * header.scales[0]:,.0f}: leave out what "
            f"lies far away, or write PLY."
        )
        raise CloudError(message)
    for axis, name in enumerate("XYZ"):
        record[name] = steps[:, axis].astype(np.int32)
    if "return_number" not in chunk.attributes:
        record["return_number"] = record["number_of_returns"] = np.ones(len(steps), np.uint8)
    attributes = _spread(chunk.attributes)
    for slot in layout:
        values = slot.convert(attributes[slot.attribute])
        if slot.extra is None and slot.dimension != "gps_time":
            values = _whole(slot.attribute, values, record.point_format, slot.dimension)
        try:
            record[slot.dimension] = values
        except OverflowError as error:
            message = f"{slot.attribute!r} does not fit the scaling of {slot.dimension!r}: {error}"
            raise CloudError(message) from error
    return record


def _whole(name: str, values: Values, point_format: Any, dimension: str) -> Values:
    """Return the values as whole numbers that fit a standard dimension."""
    allowed = point_format.dimension_by_name(dimension)
    low, high = values.min(), values.max()
    is_whole = values.dtype.kind != "f" or (values == np.rint(values)).all()
    if low < allowed.min or high > allowed.max or not is_whole:
        message = (
            f"{name!r} holds {low} to {high}, and LAS allows whole numbers from {allowed.min} "
            f"to {allowed.max} under that name: give it another name."
        )
        raise CloudError(message)
    return values.astype(np.int64)


def _coarse(header: laspy.LasHeader) -> Caution:
    message = (
        f"the points lie so far apart that LAS stores them in steps of {header.scales[0]:g} units: "
        f"leave out what lies far away, or write PLY."
    )
    return Caution("coordinates_coarse", message)


def _wkt(crs: pyproj.CRS) -> str:
    # LAS 1.4 asks for WKT 1; what only WKT 2 can say is better said than lost.
    try:
        return crs.to_wkt(WktVersion.WKT1_GDAL)
    except CRSError:
        return crs.to_wkt()
