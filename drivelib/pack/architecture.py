"""The layers of drivelib, lowest first: the one list that the test of imports and the site's API reference read.

A file may import its own layer and lower ones. The names are paths below ``drivelib/`` without ``.py``.
"""

from typing import NamedTuple


class Layer(NamedTuple):
    """One layer: what it is for, and its files."""

    name: str
    purpose: str
    files: tuple[str, ...]


LAYERS = (
    Layer("Ground", "Paths, checked input, waveforms: what everything stands on.", ("__init__", "paths", "validation", "profiles", "compiled", "papers/__init__")),
    Layer(
        "Physics",
        "Machine parameters and the equations of both papers: NumPy, SI units, an equation number in every docstring.",
        (
            "machines", "curves", "pmsm", "pmsm_angle", "pmsm_optimum", "circuits", "identification", "metrics", "dfim_machines",
            "dfim", "dfim_decoupling", "dfim_response", "pmsm_dynamics", "transients", "decimation", "table2", "table2_sets",
            "identifiability", "misprints", "dfim_optimum",
        ),
    ),
    Layer(
        "Control",
        "PI controllers by pole placement, the Mamdani controller in closed form, networks and their training.",
        (
            "control", "sigmoid", "fuzzy", "fuzzy_facts", "fuzzy_reference", "fuzzy_sets", "neural", "normal_equations", "neural_batch", "levenberg",
            "levenberg_one", "training", "networks", "speed_law", "pmsm_law", "loss_map", "fixed_point", "export_c", "export_c_pmsm",
            "dfim_map", "export_c_dfim", "encoder", "fuzzy_noise", "operations", "map_rivals",
        ),
    ),
    Layer(
        "Time",
        "Compiled drive loops with averaged or switching inverters, one or many.",
        (
            "dfim_plant", "pwm", "dfim_control", "dfim_loop", "dfim_lanes", "dfim_pieces", "dfim_many", "ensemble", "shards", "space",
            "dfim_scenario", "dfim_drive", "pmsm_plant", "pmsm_scenario", "pmsm_loop", "pmsm_drive", "ann_data", "contest",
            "table2_fit", "misprints_drive", "robustness", "robustness_steady", "robustness_ipmsm", "robustness_spmsm",
            "robustness_dfim", "robustness_ann", "robustness_contest", "robustness_scope", "tuning", "fair_networks",
            "fair_contest",
        ),
    ),
    Layer(
        "Evidence",
        "What each paper claims, the one rule that turns numbers into verdicts, and proofs of the equations in SymPy.",
        ("claims", "ledger", "symbolic", "derivations", "derivations_zidani", "derivations_rest", "units", "errata", "errata_rows"),
    ),
    Layer(
        "Face",
        "What a notebook calls: figures, diagrams, its record, exports.",
        (
            "environment", "bootstrap", "notebook", "plotting", "diagrams", "network_diagram", "schemes", "schemes_zidani",
            "orientation", "claim_map", "verdict_table", "record", "export", "interactive", "pmsm_panels", "dfim_panels",
        ),
    ),
    Layer(
        "Pack",
        "Runs the notebooks, checks, compares and reports; the command line and this site.",
        (
            "pack/__init__", "pack/architecture", "pack/freshness", "pack/worker", "pack/runner", "pack/check", "pack/report",
            "pack/readme", "pack/difference", "pack/commands", "pack/layers", "pack/publishing", "pack/review", "pack/verify",
            "pack/cells", "pack/processors", "pack/site", "pack/site_notebooks", "pack/site_pages", "pack/site_sphinx",
            "pack/site_text", "__main__", "pack/tokens", "pack/preloaded", "pack/kernels", "pack/engine", "pack/attempt",
        ),
    ),
)  # fmt: skip


def layer_of(name):
    """Return the number of a file's layer, counted from the lowest.

    Raises
    ------
    ValueError
        If the file belongs to none.
    """
    for number, layer in enumerate(LAYERS):
        if name in layer.files:
            return number
    raise ValueError(f"drivelib/{name}.py belongs to no layer; add it to LAYERS in drivelib/pack/architecture.py")


def module(name):
    """Return the module's dotted name of a file: ``drivelib.pack.site`` for ``pack/site``."""
    return ".".join(["drivelib", *(part for part in name.split("/") if part != "__init__")])
