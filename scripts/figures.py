"""The frame and the colours of pictures on pages of results."""

# Told apart by people who see fewer colours.
COLOURS = ("#4477aa", "#ee6677", "#228833", "#66ccee", "#aa3377", "#998800")

STYLE = "text{font:11px sans-serif;fill:#333}.page{fill:#fff}"
DARK = "text{fill:#ddd}.page{fill:#1c1c1c}"


def picture(title, width, height, body, style="", dark=""):
    """An SVG document with a background, for light and dark pages."""
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}">'
            f"<title>{title}</title><style>{STYLE}{style}@media(prefers-color-scheme:dark){{{DARK}{dark}}}</style>"
            f'<rect class="page" width="{width}" height="{height}"/>{body}</svg>\n')
