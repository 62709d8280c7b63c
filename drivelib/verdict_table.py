"""The table of verdicts that a notebook shows, as Markdown: printed or asked, ours, deviation, allowed, verdict."""

IN_WORDS = "in words"  # a paper's statement that carries no number
COLUMNS = {"claim": "---", "measured": "---", "paper": "---:", "ours": "---:", "deviation": "---:", "allowed": "---", "verdict": "---"}


def verdict_table(judgements, verdicts):
    """Return the table as Markdown, the cases tried and the notes beneath it; a column without an entry is left out.

    Parameters
    ----------
    judgements : sequence of ledger.Judgement
    verdicts : sequence of str
        What to show as their verdicts.
    """
    said = [_row(judgement, verdict) for judgement, verdict in zip(judgements, verdicts, strict=True)]
    kept = [name for name in COLUMNS if any(row[name] not in ("", IN_WORDS) for row in said)]
    rows = ["| " + " | ".join(kept) + " |", "|" + "|".join(COLUMNS[name] for name in kept) + "|"]
    rows += ["| " + " | ".join(table_cell(row[name]) for name in kept) + " |" for row in said]
    notes = []
    for judgement in judgements:
        parts = [part for part in (judgement.window, judgement.note) if part]
        if len(parts) == 1:
            notes.append(f"- `{judgement.claim.id}`: {parts[0]}")
        elif parts:  # one under the other: run together, the last case and the note cannot be told apart
            notes.append("\n  - ".join([f"- `{judgement.claim.id}`:", *parts]))
    if any(judgement.claim.relation not in (None, "matches") for judgement in judgements):
        notes.append("- A verdict that rests on a threshold would flip if the threshold passed our number.")
    return "\n".join(rows) + "\n\n" + "\n".join(notes)


def _row(judgement, verdict):
    claim = judgement.claim
    paper, allowed = describe(claim)
    ours = f"{judgement.ours:.5g}" if judgement.ours is not None else ""
    if judgement.as_printed is not None:
        ours += f" (as printed: {judgement.as_printed:.4g})"
    deviation = f"{judgement.deviation:+.2g}" if judgement.deviation is not None else ""
    what = f"{claim.measure} [{claim.unit}]" if claim.unit else claim.measure
    return dict(zip(COLUMNS, (f"`{claim.id}`", what, paper, ours, deviation, allowed, verdict), strict=True))


def describe(claim):
    """Return (what the paper prints, what is allowed with the reason) as text for a table."""
    if claim.relation is None:
        return "", ""
    if claim.relation == "matches":
        return claim.printed, f"± {claim.tolerance:g}: {claim.reason}"
    bounds = " to ".join(f"{bound:g}" for bound in (claim.threshold if isinstance(claim.threshold, tuple) else (claim.threshold,)))
    symbol = {"<=": "≤", ">=": "≥", "==": "=", "between": ""}[claim.relation]
    return IN_WORDS, f"{symbol} {bounds}: {claim.reason}".strip()


def table_cell(text):
    """Return a text as it must stand in a cell of a Markdown table."""
    return text.replace("|", "\\|")
