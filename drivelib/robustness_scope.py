"""Which claims of the papers are drawn, which a theorem decides, and which compare nothing.

Comparative: it sets one quantity against another or against an adjective (less, equal, slight, fast, few, none), and the outcome depends on
numbers that the paper leaves open. A test sees to it that every claim of both ledgers has exactly one place.
"""

from drivelib.robustness import Study
from drivelib.space import Span

THEOREMS = {
    "eskander/fig02": "along constant torque the loss is a sum of convex functions of i_od and R_s i_od² is strictly so: one minimum for any values",
    "eskander/fig03": "the same convexity",
    "eskander/fig02-03/x": "(11) mended is the zero of the slope of a strictly convex function, and that is its minimum",
    "eskander/fig08": "the least loss rises without end and without jump in speed, so 118.9 W is met once for any R_c and any torque that costs less at standstill",
    "eskander/fig08/percent": "a quotient of two printed numbers",
    "zidani/eq11/x": "three conditions leave one of four currents free, whatever the motor",
    "zidani/eq13/x": "(13) follows from linear equations that do not hold (11)",
    "zidani/eq15/x": "the compensation terms cancel every cross term of a linear model identically",
    "zidani/fig05/cover": "triangles cover by one half or more exactly if their feet reach the neighbours' peaks",
    "zidani/tab02/x": "arithmetic on printed digits with their rounding",
    "zidani/tab02/cauchy": "arithmetic on printed digits with their rounding",
}
_EQUATION = "an equation: proved or mended symbolically, with no open number in it"
_DRAWING = "a diagram or a definition: its statements are checked"
_TEXT = "a statement about the text itself, its notation or what it omits"
_PRINTED = "a printed number to be matched: which open values meet it is the question of the notebook omitted_numbers"
NOT_COMPARATIVE = {
    **dict.fromkeys((f"eskander/eq{k:02d}" for k in range(1, 21)), _EQUATION),
    **dict.fromkeys((f"zidani/eq{k:02d}" for k in range(1, 26)), _EQUATION),
    **dict.fromkeys(("zidani/eq16/q", "zidani/eq18/x", "zidani/eq20/x"), _EQUATION),
    **dict.fromkeys((f"eskander/fig{k}" for k in ("01", "04", "11")), _DRAWING),
    **dict.fromkeys((f"zidani/fig{k}" for k in ("01", "02", "03", "04", "05", "06", "07", "09")), _DRAWING),
    **dict.fromkeys(("zidani/tab01", "zidani/tab01/antisymmetry"), _DRAWING),
    **dict.fromkeys(("eskander/net", "eskander/net/activation", "eskander/net/goal", "eskander/net/bias", "zidani/fig08/goal", "zidani/none"), _TEXT),
    **dict.fromkeys(("eskander/app/ipmsm", "eskander/app/spmsm"), "a rating against the printed dc voltage; R_c and modulation are its alternatives in fig. 1"),
    **dict.fromkeys((f"zidani/tab02/{row}-{index}" for row in ("pi", "flc", "ann") for index in ("iae", "ise", "itae")), _PRINTED),
    **dict.fromkeys(("zidani/tab02/x/instant", "zidani/tab02/one-load"), _PRINTED),
}


def space_table(study: Study):
    """Return a Markdown table of what a study draws: assumption, range or values, unit."""
    lines = ["| assumption | drawn from | unit |", "|---|---|---|"]
    for name, values in study.space.assumptions.items():
        called, _, unit = study.labels.get(name, name).partition(" [")
        span = f"{values.low:g} to {values.high:g}{', uniform in the logarithm' if values.log else ''}" if isinstance(values, Span) else ", ".join(map(str, values))
        lines.append(f"| {called} | {span} | {unit.rstrip(']')} |")
    return "\n".join(lines)


def claims_table(rows, claims, verdicts):
    """Return a Markdown table of ``robustness.Row``: claim, when it holds, verdict, share with interval, flagged, rule.

    Parameters
    ----------
    rows : sequence of robustness.Row
    claims : mapping of str to claims.Claim
    verdicts : mapping of str to str
        As published.
    """
    lines = ["| claim | says | holds when | published verdict | holds in | 95 % interval | flagged | decided by |", "|---|---|---|---|---:|---|---:|---|"]
    for row in rows:
        claim = claims[row.claim]
        bounds = claim.allowed
        low, high = (f"{bound:g}" for bound in bounds)
        when = f"≤ {high}" if low == "-inf" else f"≥ {low}" if high == "inf" else f"{low} to {high}"
        shares = f"{100 * row.share:.1f} % | {100 * row.low:.1f} to {100 * row.high:.1f} %"
        lines.append(f"| `{row.claim}` | {claim.text} | {when} {claim.unit} | {verdicts[row.claim]} | {shares} | {row.flagged} of {row.draws} | {row.rule} |")
    return "\n".join(lines)
