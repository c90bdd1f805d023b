//! Settings of the four apparatuses: dimensions, times and stops.

use super::spec::{PLATES, SettingSpec};

const TABLE_5: &str = "paper, Table 5";
const SECTION_2_1: &str = "paper, section 2.1";
const SECTION_2_2: &str = "paper, section 2.2";
const SECTION_3_2: &str = "paper, section 3.2";
const LOST: &str = "Fig. 2 is lost; chosen so that the published simulated angles come out";
const METHOD: &str = "method; long enough to come to rest";
const TRUE_SIZE: &str = "1 = as in the other experiments";
const PILE: &[&str] = &["pile"];
const LEDGE: &[&str] = &["ledge"];
const DENSITY: &[&str] = &["bulk_density"];
const HOPPER: &[&str] = &["hopper"];

/// Geometry and procedure of every experiment.
pub const APPARATUS: &[SettingSpec] = &[
    SettingSpec::number("pile.upper_width", "m", (0.2, 0.02, 5.0), PILE, "inner width of the upper box", LOST)
        .assumed(),
    SettingSpec::number(
        "pile.slot",
        "m",
        (0.1, 0.005, 5.0),
        PILE,
        "width of the slot in the floor of the upper box, in its middle",
        LOST,
    )
    .assumed(),
    SettingSpec::number("pile.depth", "m", (0.1, 0.005, 5.0), PILE, "distance of front and back plate", LOST).assumed(),
    SettingSpec::number(
        "pile.drop_height",
        "m",
        (0.4, 0.01, 5.0),
        PILE,
        "height of the slot above the floor of the lower box",
        LOST,
    )
    .assumed(),
    SettingSpec::number(
        "pile.lower_width",
        "m",
        (1.0, 0.05, 20.0),
        PILE,
        "inner width of the lower box",
        "wide enough that no slope reaches its walls",
    )
    .assumed(),
    SettingSpec::number(
        "pile.fill_height",
        "m",
        (0.11, 0.005, 5.0),
        PILE,
        "fill height above the floor of the upper box",
        TABLE_5,
    ),
    SettingSpec::number(
        "pile.deletion_time",
        "s",
        (1.55, 0.0, 100.0),
        PILE,
        "time at which grains above the fill height are taken away",
        TABLE_5,
    ),
    SettingSpec::number(
        "pile.release_time",
        "s",
        (1.65, 0.0, 100.0),
        PILE,
        "time at which the slot opens",
        SECTION_3_2,
    ),
    SettingSpec::number(
        "pile.check_delay",
        "s",
        (0.3, 0.0, 100.0),
        PILE,
        "time after the release before a run may count as at rest; grains at release are",
        METHOD,
    )
    .assumed(),
    SettingSpec::number(
        "pile.radius_scale",
        "1",
        (1.0, 0.1, 10.0),
        PILE,
        "factor on every radius in this experiment alone, besides radius_scale",
        TRUE_SIZE,
    ),
    SettingSpec::number(
        "pile.time_cap",
        "s",
        (10.0, 0.0, 1000.0),
        PILE,
        "time at which a run ends even if grains still move",
        METHOD,
    )
    .assumed(),
    SettingSpec::number(
        "pile.trace_interval",
        "s",
        (0.01, 1e-4, 1.0),
        PILE,
        "interval at which the mass in the upper box is sampled",
        "a 100 Hz camera",
    )
    .assumed(),
    SettingSpec::number(
        "ledge.length",
        "m",
        (0.238, 0.02, 5.0),
        LEDGE,
        "inner length from the back wall to the retractable wall",
        SECTION_2_1,
    ),
    SettingSpec::number("ledge.depth", "m", (0.1, 0.005, 5.0), LEDGE, "distance of front and back plate", LOST)
        .assumed(),
    SettingSpec::number(
        "ledge.ridge_height",
        "m",
        (0.02, 0.0, 1.0),
        LEDGE,
        "height of the ridge that stays when the wall is retracted",
        SECTION_2_1,
    ),
    SettingSpec::number(
        "ledge.ridge_thickness",
        "m",
        (0.002, 1e-4, 1.0),
        LEDGE,
        "thickness of the ridge, outside the inner length",
        SECTION_2_1,
    ),
    SettingSpec::number(
        "ledge.fill_height",
        "m",
        (0.218, 0.005, 5.0),
        LEDGE,
        "fill height above the floor (the experiment: 0.214 m)",
        TABLE_5,
    ),
    SettingSpec::number(
        "ledge.deletion_time",
        "s",
        (1.55, 0.0, 100.0),
        LEDGE,
        "time at which grains above the fill height are taken away",
        TABLE_5,
    ),
    SettingSpec::number(
        "ledge.release_time",
        "s",
        (1.65, 0.0, 100.0),
        LEDGE,
        "time at which the wall is retracted",
        SECTION_3_2,
    ),
    SettingSpec::number(
        "ledge.check_delay",
        "s",
        (0.3, 0.0, 100.0),
        LEDGE,
        "time after the release before a run may count as at rest; grains at release are",
        METHOD,
    )
    .assumed(),
    SettingSpec::number(
        "ledge.radius_scale",
        "1",
        (1.0, 0.1, 10.0),
        LEDGE,
        "factor on every radius in this experiment alone, besides radius_scale",
        TRUE_SIZE,
    ),
    SettingSpec::number(
        "ledge.time_cap",
        "s",
        (10.0, 0.0, 1000.0),
        LEDGE,
        "time at which a run ends even if grains still move",
        METHOD,
    )
    .assumed(),
    SettingSpec::number(
        "ledge.trace_interval",
        "s",
        (0.01, 1e-4, 1.0),
        LEDGE,
        "interval at which the mass on the ledge is sampled",
        "a 100 Hz camera",
    )
    .assumed(),
    SettingSpec::number(
        "bulk_density.radius",
        "m",
        (0.082, 0.005, 5.0),
        DENSITY,
        "inner radius of the cylinder",
        SECTION_2_1,
    ),
    SettingSpec::number(
        "bulk_density.height",
        "m",
        (0.237, 0.005, 5.0),
        DENSITY,
        "height of the cylinder, for its volume",
        SECTION_2_1,
    )
    .measured(),
    SettingSpec::number(
        "bulk_density.fill_height",
        "m",
        (0.236, 0.005, 5.0),
        DENSITY,
        "height above which grains are taken away",
        TABLE_5,
    ),
    SettingSpec::number(
        "bulk_density.deletion_time",
        "s",
        (1.5, 0.0, 100.0),
        DENSITY,
        "time at which grains above the fill height are taken away",
        TABLE_5,
    ),
    SettingSpec::number(
        "bulk_density.radius_scale",
        "1",
        (1.0, 0.1, 10.0),
        DENSITY,
        "factor on every radius in this experiment alone, besides radius_scale",
        TRUE_SIZE,
    ),
    SettingSpec::number(
        "bulk_density.time_cap",
        "s",
        (10.0, 0.0, 1000.0),
        DENSITY,
        "time at which a run ends even if grains still move",
        METHOD,
    )
    .assumed(),
    SettingSpec::number(
        "bulk_density.tap_height",
        "m",
        (0.0, 0.0, 0.05),
        DENSITY,
        "height from which the cylinder is dropped, again and again, before it is struck off; 0 = not at all",
        "absent in the paper; tapping devices drop by 3 mm (EN ISO 787-11)",
    )
    .silent(),
    SettingSpec::number(
        "bulk_density.taps",
        "1",
        (5.0, 1.0, 1000.0),
        DENSITY,
        "number of drops from tap_height",
        "a few knocks against the bench",
    )
    .assumed()
    .silent(),
    SettingSpec::number(
        "release_duration",
        "s",
        (0.0, 0.0, 10.0),
        PLATES,
        "time in which gate or wall is pulled away at constant speed; 0 = it vanishes",
        "absent in the paper's model",
    )
    .silent(),
    SettingSpec::number("hopper.width", "m", (0.602, 0.02, 20.0), HOPPER, "inner width of the bin", SECTION_2_2),
    SettingSpec::number(
        "hopper.depth",
        "m",
        (0.05, 0.005, 5.0),
        HOPPER,
        "distance of front and back plate",
        SECTION_2_2,
    ),
    SettingSpec::number("hopper.slot", "m", (0.1, 0.005, 5.0), HOPPER, "width of the outlet", SECTION_2_2),
    SettingSpec::number(
        "hopper.wall_angle",
        "deg",
        (45.0, 5.0, 85.0),
        HOPPER,
        "angle of the inclined walls to the horizontal",
        SECTION_2_2,
    ),
    SettingSpec::number("hopper.fill_height", "m", (0.66, 0.01, 20.0), HOPPER, "fill height above the outlet", TABLE_5),
    SettingSpec::number(
        "hopper.deletion_time",
        "s",
        (1.5, 0.0, 100.0),
        HOPPER,
        "time at which grains above the fill height are taken away",
        TABLE_5,
    ),
    SettingSpec::number(
        "hopper.release_time",
        "s",
        (1.6, 0.0, 100.0),
        HOPPER,
        "time at which the outlet opens",
        SECTION_3_2,
    ),
    SettingSpec::number(
        "hopper.check_delay",
        "s",
        (0.3, 0.0, 100.0),
        HOPPER,
        "time after the release before a run may count as at rest; grains at release are",
        METHOD,
    )
    .assumed(),
    SettingSpec::number(
        "hopper.radius_scale",
        "1",
        (1.0, 0.1, 10.0),
        HOPPER,
        "factor on every radius in this experiment alone, besides radius_scale",
        TRUE_SIZE,
    ),
    SettingSpec::number(
        "hopper.time_cap",
        "s",
        (30.0, 0.0, 1000.0),
        HOPPER,
        "time at which a run ends even if grains are left",
        METHOD,
    )
    .assumed(),
    SettingSpec::number(
        "hopper.trace_interval",
        "s",
        (0.02, 1e-4, 1.0),
        HOPPER,
        "interval at which the mass in the hopper is sampled (50 Hz)",
        SECTION_2_2,
    ),
];
