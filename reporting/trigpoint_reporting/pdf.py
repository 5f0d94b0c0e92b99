"""The PDF of a report, made from its HTML by WeasyPrint: PDF/A where its fonts have all it says."""

from __future__ import annotations

import base64
import datetime as dt
import importlib.util
import logging
import os
import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from html import unescape
from io import StringIO
from pathlib import Path
from typing import Any, Literal
from urllib.parse import unquote, urlsplit
from urllib.request import url2pathname

from trigpoint.errors import MissingPackageError, TrigpointError
from trigpoint_reporting.lettering import join_letters_in
from trigpoint_reporting.palettes import palette_images
from trigpoint_templates import FOLDER, FONTS, PRINT_CSS

Variant = Literal["a-3a", "a-2a"]
# Where a project states no date: one that is visibly none.
NO_DATE = dt.date(1980, 1, 1)
# No style prints these, and reading them takes time; nor does the mark about each number change
# its look. A project's texts are escaped: none is markup.
UNPRINTED = re.compile(
    r'<details class="code">.*?</details>|<figure class="viewer">.*?</figure>|</?data\b[^>]*>',
    re.DOTALL,
)
LIBRARIES = "libpango-1.0-0 libpangoft2-1.0-0 libharfbuzz-subset0"
# Stated here and not guessed by each machine for itself.
MEDIA_TYPES = {
    ".csv": "text/csv",
    ".ipynb": "application/x-ipynb+json",
    ".json": "application/json",
    ".py": "text/x-python",
    ".toml": "application/toml",
}


class PdfError(TrigpointError, ValueError):
    """A report can't be made into a sound PDF."""

    code = "pdf"


def write_pdf(
    html: str,
    path: Path,
    *,
    variant: Variant | None = "a-3a",
    attachments: Mapping[str, Path] | None = None,
    date: dt.date | None = None,
) -> None:
    """Write a report as PDF.

    It is declared to be PDF/A, unless its letters can't all be embedded; only a validator could
    say that it is.

    Parameters
    ----------
    html : str
        As `AuditExporter` makes it.
    path : Path
    variant : {"a-3a", "a-2a"} or None, optional
        a-2a allows no attachment; None declares nothing.
    attachments : mapping of str to Path, optional
        Files to embed, by the path that they have in the bundle.
    date : date, optional
        Of the attachments: the project's, since a file's own would differ from run to run.

    Raises
    ------
    MissingPackageError
        If WeasyPrint or a library of the system that it needs is missing.
    PdfError
        If the HTML asks for anything outside itself, or WeasyPrint reports an error.
    """
    weasyprint = _weasyprint()
    given = attachments or {}
    if variant == "a-2a" and given:
        message = f"PDF/A-2 holds no attachments, and {len(given)} were given; use a-3a for them."
        raise PdfError(message)
    # After the report's own style and not through `stylesheets`, which it would overrule.
    sheet = f"<style>{PRINT_CSS.read_text('utf-8')}\n{_fallback_fonts()}</style></head>"
    styled = join_letters_in(UNPRINTED.sub("", html)).replace("</head>", sheet, 1)
    moment = dt.datetime.combine(date or NO_DATE, dt.time())
    files = [
        weasyprint.Attachment(
            url=_data_url(file),
            # Names are unique and sorted, as a PDF's name tree must be.
            name=name.replace("/", "-"),
            description=name,
            created=moment,
            modified=moment,
            relationship="Source" if name.endswith((".ipynb", ".py")) else "Data",
        )
        for name, file in sorted(given.items(), key=lambda item: item[0].replace("/", "-"))
    ]
    draft = path.with_name(f".{path.name}.draft")
    try:
        with _errors_raised(), _fixed_clock(moment), warnings.catch_warnings():
            # WeasyPrint leaves its colour profile for the garbage collector to close.
            warnings.simplefilter("ignore", ResourceWarning)
            source = weasyprint.HTML(
                string=styled, base_url=f"{FOLDER.as_uri()}/", url_fetcher=_fetcher()
            )
            source.write_pdf(
                draft,
                attachments=files,
                pdf_variant=None if variant is None else f"pdf/{variant}",
                pdf_tags=True,
                finisher=_finish,
                cache=palette_images(styled),
            )
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)


def letters_without_font(html: str) -> str:
    """Return the letters of a report that none of its fonts has, in order, each once.

    They are drawn in whatever font this machine has for them, or as boxes.
    """
    from fontTools.ttLib import TTFont  # type: ignore[import-untyped]

    known: set[int] = set()
    for font in (FONTS / "IBMPlexSans-Regular.woff", _matplotlib_fonts() / "DejaVuSans.ttf"):
        with TTFont(font) as opened:
            known.update(opened.getBestCmap())
    letters = set(unescape(re.sub("<[^>]*>", "", html)))
    return "".join(sorted(x for x in letters if ord(x) not in known and not x.isspace()))


def _weasyprint() -> Any:
    try:
        # It prints what it lacks, where a JSON object may be expected: the message below says it.
        with redirect_stdout(StringIO()), warnings.catch_warnings():
            # Without harfbuzz-subset it warns of a version to come; the clock below is fixed.
            warnings.simplefilter("ignore")
            import weasyprint  # type: ignore[import-untyped]
    except ImportError as error:
        message = 'The PDF needs WeasyPrint: pip install "trigpoint[reporting]".'
        raise MissingPackageError(message) from error
    except OSError as error:
        message = (
            f"The PDF needs libraries that this system lacks: {LIBRARIES} (on Debian: "
            f"apt-get install {LIBRARIES})."
        )
        raise MissingPackageError(message) from error
    return weasyprint


def _fetcher() -> Any:
    """Return what opens URLs for WeasyPrint: data that stands in the HTML, and our fonts."""
    from weasyprint.urls import FatalURLFetchingError, URLFetcher  # type: ignore[import-untyped]

    class OwnFiles(URLFetcher):  # type: ignore[misc]
        def fetch(self, url: str, headers: Any = None) -> Any:
            parts = urlsplit(url)
            own = parts.scheme == "file" and any(
                Path(url2pathname(unquote(parts.path))).resolve().is_relative_to(folder)
                for folder in (FOLDER.resolve(), _matplotlib_fonts())
            )
            if not own and parts.scheme != "data":
                # Not an Exception: those WeasyPrint turns into a line in its log.
                message = f"The report asks for {url[:200]}, which lies outside it."
                raise FatalURLFetchingError(message)
            return super().fetch(url, headers)

    return OwnFiles()


def _matplotlib_fonts() -> Path:
    """Where Matplotlib keeps the DejaVu fonts: they have the scripts and signs that Plex lacks."""
    found = importlib.util.find_spec("matplotlib")
    if found is None or found.origin is None:
        message = 'Reports need Matplotlib: pip install "trigpoint[reporting]".'
        raise MissingPackageError(message)
    return (Path(found.origin).parent / "mpl-data" / "fonts" / "ttf").resolve()


def _fallback_fonts() -> str:
    folder = _matplotlib_fonts()
    faces = (
        ("DejaVu Sans", "DejaVuSans.ttf", 400),
        ("DejaVu Sans", "DejaVuSans-Bold.ttf", 600),
        ("DejaVu Sans Mono", "DejaVuSansMono.ttf", 400),
    )
    return "\n".join(
        f'@font-face {{ font-family: "{family}"; src: url({(folder / file).as_uri()}); '
        f"font-weight: {weight}; }}"
        for family, file, weight in faces
    )


def _data_url(file: Path) -> str:
    media_type = MEDIA_TYPES.get(file.suffix, "text/plain")
    return f"data:{media_type};base64,{base64.b64encode(file.read_bytes()).decode('ascii')}"


def _finish(_: Any, pdf: Any) -> None:
    # WeasyPrint 70 lists each attachment twice among the associated files.
    if "AF" in pdf.catalog:
        listed = dict.fromkeys(pdf.catalog["AF"])
        pdf.catalog["AF"][:] = listed
    # The file's identifier is made from all that is written, which pydyf deflates anew for it.
    for stream in pdf.objects:
        if getattr(stream, "compress", False):
            deflated = stream.data.partition(b"\nstream\n")[2].removesuffix(b"\nendstream")
            stream.stream, stream.compress = [deflated], False
            stream.extra = {**stream.extra, "Filter": "/FlateDecode"}


@contextmanager
def _errors_raised() -> Iterator[None]:
    """Turn WeasyPrint's logged errors, and its refusal of a URL, into a `PdfError`."""
    from weasyprint.urls import FatalURLFetchingError

    logger = logging.getLogger("weasyprint")
    found = _Collected()
    logger.addHandler(found)
    propagated, logger.propagate = logger.propagate, False
    try:
        yield
    except FatalURLFetchingError as error:
        raise PdfError(str(error)) from error
    finally:
        logger.removeHandler(found)
        logger.propagate = propagated
    if found.messages:
        message = f"The PDF would not be sound: {'; '.join(dict.fromkeys(found.messages))}"
        raise PdfError(message)


class _Collected(logging.Handler):
    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.messages.append(record.getMessage())


@contextmanager
def _fixed_clock(moment: dt.datetime) -> Iterator[None]:
    """Keep the time out of the fonts: fontTools stamps what it converts."""
    name = "SOURCE_DATE_EPOCH"
    before = os.environ.get(name)
    os.environ[name] = str(int(moment.replace(tzinfo=dt.UTC).timestamp()))
    try:
        yield
    finally:
        if before is None:
            del os.environ[name]
        else:
            os.environ[name] = before
