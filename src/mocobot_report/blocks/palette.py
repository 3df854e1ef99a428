"""Colours of the page, light and dark. Series follow Okabe and Ito's colour-blind safe set, each made darker or lighter
until it stands out from its background."""

_THEMES = {
    "page": ("#f6f7f9", "#0f141a"),
    "card": ("#ffffff", "#171d25"),
    "sunk": ("#eef1f5", "#1f2731"),
    "text": ("#18202b", "#e8edf3"),
    "soft": ("#4f5b6b", "#a9b5c3"),
    "line": ("#d5dbe3", "#34404e"),
    "grid": ("#e3e8ee", "#2a3440"),
    "link": ("#0a5ca8", "#7cc0ff"),
    "focus": ("#0a5ca8", "#7cc0ff"),
    "good": ("#116b43", "#63d6a1"),
    "good-card": ("#e3f4eb", "#12352a"),
    "warn": ("#804d00", "#f2bd5c"),
    "warn-card": ("#fdf0d8", "#3a2c10"),
    "bad": ("#a3261b", "#ff9c90"),
    "bad-card": ("#fde8e5", "#431d1a"),
    "paper": ("#59616d", "#b8c1cc"),
    "ideal": ("#00805c", "#2fc49a"),
    "nominal": ("#0068b0", "#56b4e9"),
    "uncalibrated": ("#c24e00", "#f2904a"),
    "before": ("#c24e00", "#f2904a"),
    "after": ("#0068b0", "#56b4e9"),
    "truth": ("#00805c", "#2fc49a"),
    "band": ("#dde3ea", "#2b3541"),
    "c1": ("#a6407d", "#e08fc0"),
    "c2": ("#8a6a00", "#e3c04a"),
    "c3": ("#00805c", "#2fc49a"),
    "r1": ("#0068b0", "#56b4e9"),
    "r2": ("#c24e00", "#f2904a"),
    "r3": ("#00805c", "#2fc49a"),
    "r4": ("#a6407d", "#e08fc0"),
    "r5": ("#8a6a00", "#e3c04a"),
    "r6": ("#59616d", "#b8c1cc"),
}
"""Every colour on a light and on a dark page."""
LIGHT = {name: light for name, (light, _) in _THEMES.items()}
DARK = {name: dark for name, (_, dark) in _THEMES.items()}

PRESETS = {"paper": "diamond", "ideal": "triangle-down", "nominal": "circle", "uncalibrated": "square"}
"""Marker of each column of the paper's tables; its colour has the same name."""
OTHER_COLOURS, OTHER_MARKERS = ("c1", "c2"), ("triangle-up", "circle-open", "x")
