"""The report as Markdown and as one HTML page with its pictures inside."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

HEAD = """<!doctype html><meta charset="utf-8"><title>LEMTOMap: chapter 5 again</title>
<style>body{font:15px/1.5 sans-serif;max-width:1150px;margin:2em auto;padding:0 1em}img{max-width:100%}
table{border-collapse:collapse;margin:1em 0;font-size:13px}
td,th{border:1px solid #ccc;padding:.3em .7em;text-align:right}
td:first-child,th:first-child{text-align:left}figcaption{font-size:13px;color:#444}</style>"""


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture and what it shows."""

    path: Path
    caption: str


@dataclass(frozen=True, slots=True)
class Section:
    """A heading, paragraphs, lists and tables in Markdown, pictures."""

    heading: str
    text: str
    pictures: Sequence[Picture] = field(default=())


def write_report(out: Path, title: str, sections: Sequence[Section]) -> None:
    """Write report.md (pictures beside it) and report.html (pictures in it)."""
    markdown, html = [f"# {title}"], [HEAD, f"<h1>{escape(title)}</h1>"]
    for section in sections:
        markdown += [f"## {section.heading}", section.text]
        html += [f"<h2>{escape(section.heading)}</h2>", to_html(section.text)]
        for picture in section.pictures:
            caption = " ".join(picture.caption.split())
            markdown.append(f"![{caption}]({picture.path.relative_to(out)})\n\n*{caption}*")
            data = base64.b64encode(picture.path.read_bytes()).decode()
            image = f'<img src="data:image/png;base64,{data}" alt="{escape(caption)}">'
            html.append(f"<figure>{image}<figcaption>{escape(caption)}</figcaption></figure>")
    (out / "report.md").write_text("\n\n".join(markdown) + "\n")
    (out / "report.html").write_text("\n".join(html) + "\n")


def to_html(text: str) -> str:
    """Turn paragraphs, lists and tables of Markdown into HTML."""
    return "\n".join(_block(block.splitlines()) for block in text.split("\n\n") if block.strip())


def _block(lines: Sequence[str]) -> str:
    if lines[0].startswith("|"):
        cells = [[escape(cell.strip()) for cell in line.strip("|").split("|")] for line in lines]
        head = "".join(f"<th>{cell}</th>" for cell in cells[0])
        body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in cells[2:])
        return f"<table><tr>{head}</tr>{body}</table>"
    if lines[0].startswith("- "):
        return "<ul>" + "".join(f"<li>{escape(line[2:])}</li>" for line in lines) + "</ul>"
    return f"<p>{escape(' '.join(lines))}</p>"
