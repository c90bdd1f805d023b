//! Settings of the instruments: what a camera, a scale and an analyst make of the grains. None of them moves a grain.

use super::spec::{SLOPES, SettingSpec};

const OURS: &str = "absent in the paper";

/// KPI operators and instrument errors.
pub const INSTRUMENT: &[SettingSpec] = &[
    SettingSpec::choice(
        "slope_operator",
        &["front", "slices", "silhouette"],
        SLOPES,
        "grains an eye sees: front layer only; every depth slice one diameter thick, averaged; or the \
         highest over the whole depth",
        "paper, section 3.3: front",
    )
    .measured(),
    SettingSpec::number(
        "nominal_radius",
        "m",
        (5.02e-3, 1e-4, 0.1),
        SLOPES,
        "mean radius the analyst believes in (times the scale of the radii): bins, layers and slices are one \
         diameter wide",
        "paper, section 3.3",
    )
    .measured(),
    SettingSpec::number(
        "front_layer",
        "1",
        (1.0, 0.1, 100.0),
        SLOPES,
        "a grain is at the front if its centre lies within this many mean diameters of the plate",
        "the paper does not say",
    )
    .measured()
    .assumed(),
    SettingSpec::number(
        "slice_thickness",
        "1",
        (1.0, 0.1, 100.0),
        SLOPES,
        "thickness of a depth slice in mean diameters",
        "one grain",
    )
    .measured()
    .assumed()
    .silent(),
    SettingSpec::number(
        "bin_width",
        "1",
        (1.0, 0.2, 10.0),
        SLOPES,
        "width of a bin in mean diameters",
        "paper, section 3.3",
    )
    .measured(),
    SettingSpec::choice(
        "empty_bins",
        &["skip", "floor", "refuse"],
        SLOPES,
        "a bin without a grain is left out, is read as bare floor, or makes the run give no angle",
        "the paper does not say",
    )
    .measured()
    .assumed(),
    SettingSpec::number(
        "bins_needed",
        "1",
        (3.0, 3.0, 100.0),
        SLOPES,
        "fewest filled bins a regression is made of",
        "two define a line, three its roughness",
    )
    .measured()
    .assumed(),
    SettingSpec::number(
        "streak_speed",
        "m/s",
        (0.3, 0.0, 1e3),
        SLOPES,
        "a grain faster than this is a streak in the picture, not part of an outline: it is still falling",
        "free fall over about half a diameter",
    )
    .measured()
    .assumed(),
    SettingSpec::number(
        "camera_roll",
        "deg",
        (0.0, -20.0, 20.0),
        SLOPES,
        "the picture is rolled counter-clockwise",
        OURS,
    )
    .measured(),
    SettingSpec::number(
        "pile.window_outer",
        "m",
        (0.1, 0.01, 1.0),
        &["pile"],
        "outer end of the angle window, from the centre",
        "paper, section 3.3",
    )
    .measured(),
    SettingSpec::number(
        "pile.window_inner",
        "m",
        (0.01, 0.0, 1.0),
        &["pile"],
        "inner end of the angle window, from the centre",
        "paper, section 3.3",
    )
    .measured(),
    SettingSpec::number(
        "pile.wall_clearance",
        "m",
        (0.0, 0.0, 1.0),
        &["pile"],
        "room a heap must leave to the side walls of the lower box, above the thickness of one grain",
        "the paper does not say",
    )
    .measured()
    .assumed(),
    SettingSpec::number(
        "pile.steady_from",
        "1",
        (0.2, 0.0, 1.0),
        &["pile"],
        "discharged share at which the discharge counts as steady",
        "the paper does not say",
    )
    .measured()
    .assumed(),
    SettingSpec::number(
        "pile.steady_to",
        "1",
        (0.8, 0.0, 1.0),
        &["pile"],
        "discharged share at which the steady discharge ends",
        "the paper does not say",
    )
    .measured()
    .assumed(),
    SettingSpec::number(
        "ledge.window_start",
        "m",
        (0.06, 0.0, 1.0),
        &["ledge"],
        "start of the angle window from the back wall at the largest friction: d_s = max(mu_s, \
         mu_r)/window_friction * window_start",
        "paper, section 3.3",
    )
    .measured(),
    SettingSpec::number(
        "ledge.window_friction",
        "1",
        (0.9, 0.01, 10.0),
        &["ledge"],
        "friction at which the angle window starts at window_start",
        "paper, section 3.3",
    )
    .measured(),
    SettingSpec::number(
        "ledge.window_end",
        "m",
        (0.228, 0.01, 2.0),
        &["ledge"],
        "end of the angle window from the back wall",
        "paper, section 3.3",
    )
    .measured(),
    SettingSpec::choice(
        "bulk_density.count",
        &["remaining", "centre", "whole", "cut"],
        &["bulk_density"],
        "grains that count: all that deletion left; centre below the fill height; wholly below it; or \
         the part of each below it",
        "paper, section 3.3: each particle in the container",
    )
    .measured(),
    SettingSpec::choice(
        "bulk_density.volume",
        &["container", "filled"],
        &["bulk_density"],
        "volume divided by: that of the cylinder, or that below the fill height (0.42 % less)",
        "paper, section 3.3: the container",
    )
    .measured(),
    SettingSpec::number(
        "bulk_density.tare",
        "kg",
        (0.0, -10.0, 10.0),
        &["bulk_density"],
        "error of the scale's tare, added to every weighing",
        OURS,
    )
    .measured(),
    SettingSpec::number(
        "hopper.steady_from",
        "1",
        (0.2, 0.0, 1.0),
        &["hopper"],
        "discharged share at which the flow counts as steady",
        "the paper does not say",
    )
    .measured()
    .assumed(),
    SettingSpec::number(
        "hopper.steady_to",
        "1",
        (0.8, 0.0, 1.0),
        &["hopper"],
        "discharged share at which the steady flow ends",
        "the paper does not say",
    )
    .measured()
    .assumed(),
    SettingSpec::number(
        "hopper.load_cell_gain",
        "1",
        (0.0, -0.5, 0.5),
        &["hopper"],
        "relative error of the load cells",
        OURS,
    )
    .measured(),
    SettingSpec::number(
        "steady_points",
        "1",
        (5.0, 3.0, 1000.0),
        &["pile", "hopper"],
        "fewest samples of mass a discharge rate is fitted to",
        "three show a bend",
    )
    .measured()
    .assumed(),
    SettingSpec::number(
        "pile.clogged_share",
        "1",
        (0.2, 0.0, 1.0),
        &["pile"],
        "least share of the upper box's mass that must fall, or the run counts as clogged",
        "the paper does not say",
    )
    .measured()
    .assumed(),
    SettingSpec::number(
        "hopper.clogged_share",
        "1",
        (0.9, 0.0, 1.0),
        &["hopper"],
        "least share of the hopper's mass that must leave, or the run counts as clogged",
        "the hopper empties",
    )
    .measured()
    .assumed(),
];
