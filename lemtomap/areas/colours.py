"""The colour of an area, the same in every picture and in the viewer."""

COLOURS = (
    "#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#e377c2", "#7f7f7f", "#bcbd22",
    "#17becf", "#393b79", "#637939", "#8c6d31", "#843c39", "#7b4173", "#3182bd", "#e6550d", "#31a354",
    "#756bb1", "#636363",
)  # fmt: skip
STEP = 7  # through the colours: areas that follow one another look different


def colour_of(area_id: int) -> str:
    """Return the colour of an area, the same in every picture; grey for none."""
    return COLOURS[area_id * STEP % len(COLOURS)] if area_id > 0 else "#b0b0b0"
