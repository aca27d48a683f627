"""The page of a prepared capture: measures before and after, what was changed, pictures and a replay of both."""

from html import escape

from experiments.files.html_page import html_page, image
from experiments.flights.ballistics import clip_flights
from experiments.preparation.both import both_html
from experiments.preparation.filmstrip import filmstrip
from experiments.preparation.prepared_file import PreparedFile, advice, changes
from models.mocap.preparation.well_formed import well_formed


def page(outcome: PreparedFile) -> str:
    """The report as a self-contained page: measures before and after, what was changed, pictures and replay of both."""
    made = outcome.made
    before = well_formed(made.captured, clip_flights(made.captured))
    picture = image(filmstrip({"as captured": made.captured, "prepared": made.clip}), "stick figures")
    rows = "".join(
        f"<tr><th>{name}</th><td>{escape(was)}</td><td>{escape(now)}</td></tr>"
        for name, was, now in zip(
            ("soles", "ends", "continuity", "dynamics"), before.lines(), outcome.measures.lines(), strict=True
        )
    )

    def listed(title: str, lines: tuple[str, ...]) -> str:
        points = "".join(f"<li>{escape(line)}</li>" for line in lines)
        return f"<h2>{title}</h2><ul>{points}</ul>" if lines else ""

    well = "Well-formed." if made.near and not outcome.faults() else "Not well-formed."
    body = (
        f'<p>{well} {escape(outcome.followed.line().capitalize())}.</p><div class="wide"><table>'
        f"<tr><th></th><th>captured</th><th>prepared</th></tr>{rows}</table></div>"
        + listed("What was changed", changes(made))
        + listed("What is not within bounds, or not certified", (*outcome.faults(), *outcome.doubts, *advice(made)))
        + f'<iframe title="both in 3D" srcdoc="{escape(both_html(made.captured, made.clip))}"></iframe>'
        + picture
        + listed("What the file was taken for", made.report.lines() if made.report else ())
    )
    style = "th, td { text-align: left; vertical-align: top; }"
    return html_page(f"{made.clip.name}, prepared", body, style)
