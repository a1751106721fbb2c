"""The table of stages beside the tables that name its entries: figures, numbers of the root, datasheet."""

from fractalcontact.plotting._draw import FIGURES
from fractalcontact.scenes._result_tree import MAIN
from fractalcontact.scenes._stages import STAGES
from fractalcontact.scenes._summary import SHOWN

WITHOUT_TABLE = {
    "surfaces/description",  # in the file it is part of the surface, whose table has its numbers
    "joints/delta_surface",  # heights
    "domains/box_counts",  # curves
    "domains/hausdorff_content",
    "domains/lineage",  # a row for each island
    "figures",
}
WITHOUT_FIGURE = {
    "surfaces/description",  # single numbers
    "surfaces/texture",
    "joints/faces",
    "joints/closure_laws",
    "joints/elimination",
    "joints/roughness_coefficient",
    "domains/percolation",  # `path_figure` of its function
    "domains/box_counts",  # what is measured on their curves is drawn
    "domains/generalised_dimensions",
    "domains/boundary_dimension",
    "domains/hausdorff_content",
    "domains/describe",
    "figures",
}


def test_every_stage_has_a_table_or_states_that_it_has_none():
    """The curves that are computed for figures alone have none."""
    assert {name for name, row in STAGES.items() if row.rows is None and not row.for_figures} == WITHOUT_TABLE


def test_every_stage_has_a_figure_or_states_that_it_has_none():
    drawn = {row.group for row in FIGURES}
    assert drawn <= STAGES.keys() | {"overview", "dimensions/*"}
    curves = {name for name, row in STAGES.items() if row.for_figures}
    assert {name.partition("/")[0] for name in curves} == {"dimensions"}  # all in one figure
    assert STAGES.keys() - drawn - curves == WITHOUT_FIGURE


def test_datasheet_names_columns_of_the_stages():
    for name, heads in SHOWN.items():
        assert set(heads) <= {column.head for column in STAGES[name].rows.columns}


def test_main_numbers_are_of_stages():
    assert {group for entry in MAIN for group in entry.groups} <= STAGES.keys()
