"""Words for relative errors, for terminals, pages and reports; lists of tables load nothing else for them."""

from __future__ import annotations

# Errors [1] that are not told apart, that read better as factors, and as factors with an exponent
_SMALL_ERROR, _LARGE_ERROR, _HUGE_ERROR = 1e-5, 10.0, 1e4


def error_in_words(error: float | None) -> str:
    """Return a relative error [1] as text: in percent, or above 1000 % as a factor."""
    if error is None:
        return "not measured"
    if error < _SMALL_ERROR:
        return "< 0.001 %"
    if error > _LARGE_ERROR:
        return f"a factor of {round(1.0 + error)}" if error < _HUGE_ERROR else f"a factor of {error:.2g}"
    return f"{100.0 * error:.0f} %" if error >= 0.995 else f"{100.0 * error:#.2g}".rstrip(".") + " %"
