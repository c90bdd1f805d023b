//! Settings of the grains, the contact law, the walls' material and the numerical method.

use super::spec::{ALL, PLATES, SettingSpec};

const TABLE_1: &str = "paper, Table 1, mean";
const TABLE_3: &str = "paper, Table 3";
const TABLE_4: &str = "paper, Table 4";

/// Sieves of the curve that `size_distribution = "sieve"` reads, and the share of the mass that passes each.
pub const SIEVES: [(&str, &str); 6] = [
    ("sieve_size_1", "sieve_finer_1"),
    ("sieve_size_2", "sieve_finer_2"),
    ("sieve_size_3", "sieve_finer_3"),
    ("sieve_size_4", "sieve_finer_4"),
    ("sieve_size_5", "sieve_finer_5"),
    ("sieve_size_6", "sieve_finer_6"),
];

const ABSENT: &str = "absent in the paper";

const fn sieve_size(number: usize) -> SettingSpec {
    let meaning = "opening of a sieve of the curve, smallest first; 0 = there is no such sieve";
    SettingSpec::number(SIEVES[number].0, "m", (0.0, 0.0, 0.2), ALL, meaning, ABSENT).silent()
}

const fn sieve_finer(number: usize) -> SettingSpec {
    let meaning = "share of the mass that passes the sieve of that number; 0 at the first, 1 at the last";
    SettingSpec::number(SIEVES[number].1, "1", (0.0, 0.0, 1.0), ALL, meaning, ABSENT).silent()
}

/// Material and method, shared by the experiments.
pub const MATERIAL: &[SettingSpec] = &[
    SettingSpec::number(
        "sliding_friction",
        "1",
        (0.5, 0.0, 2.0),
        ALL,
        "sliding friction between grains, mu_s",
        "calibrated; Fig. 7 shows 0.5",
    ),
    SettingSpec::number(
        "rolling_friction",
        "1",
        (0.5, 0.0, 2.0),
        ALL,
        "rolling friction between grains, mu_r (torque limit mu_r |F_n| D, D = 2 R_i R_j/(R_i + R_j))",
        "calibrated; Fig. 7 shows 0.5",
    ),
    SettingSpec::number(
        "particle_density",
        "kg/m3",
        (2750.0, 100.0, 20_000.0),
        ALL,
        "density of a grain, rho_p",
        "calibrated; Fig. 7 shows 2750",
    ),
    SettingSpec::number(
        "friction_spread_cv",
        "1",
        (0.0, 0.0, 1.0),
        ALL,
        "coefficient of variation of friction from grain to grain (lognormal); 0 = all grains alike",
        "absent in the paper",
    ),
    SettingSpec::number(
        "rolling_spread_cv",
        "1",
        (0.0, 0.0, 1.0),
        ALL,
        "coefficient of variation of rolling friction alone from grain to grain, besides friction_spread_cv",
        "absent in the paper",
    )
    .silent(),
    SettingSpec::number(
        "aspect_ratio",
        "1",
        (1.0, 1.0, 2.5),
        ALL,
        "length over width of the grains: rigid clumps of two (to 1.6) or three equal spheres in a row; 1 = spheres",
        "absent in the paper",
    )
    .silent(),
    SettingSpec::number(
        "fines_fraction",
        "1",
        (0.0, 0.0, 0.5),
        ALL,
        "mass of grains below the lower cut over the mass of all grains",
        "absent in the paper, whose distribution is cut",
    )
    .silent(),
    SettingSpec::number(
        "fines_size",
        "1",
        (0.7, 0.2, 1.0),
        ALL,
        "radius of the fines over the smallest radius of the cut distribution; sets the time step where there are fines",
        "one sieve of the R20/3 series below the cut",
    )
    .assumed()
    .silent(),
    SettingSpec::number(
        "drag_coefficient",
        "1",
        (0.0, 0.0, 10.0),
        ALL,
        "drag coefficient of a grain in still air of 1.2 kg/m3, force C_d rho A v^2/2; 0 = vacuum",
        "absent in the paper; a sphere has 0.44",
    )
    .silent(),
    SettingSpec::number(
        "series_length",
        "1",
        (50.0, 2.0, 1e5),
        ALL,
        "repetitions of one laboratory series; what drifts is as measured in its middle and begins anew after its end",
        "paper, section 2.1: 50 repetitions",
    )
    .of_series()
    .silent(),
    SettingSpec::number(
        "radius_mean",
        "m",
        (5.02e-3, 1e-4, 0.1),
        ALL,
        "mean of the normal or lognormal distribution of radii before truncation; for the others the nominal \
         size, by which outlines are binned",
        TABLE_3,
    ),
    SettingSpec::number(
        "radius_sd",
        "m",
        (1.39e-3, 0.0, 0.05),
        ALL,
        "standard deviation of the radii before truncation",
        TABLE_3,
    ),
    SettingSpec::number(
        "radius_cut_below",
        "1",
        (1.5, 0.0, 10.0),
        ALL,
        "standard deviations below the mean at which radii are cut",
        TABLE_3,
    ),
    SettingSpec::number(
        "radius_cut_above",
        "1",
        (5.0, 0.0, 10.0),
        ALL,
        "standard deviations above the mean at which radii are cut",
        TABLE_3,
    ),
    SettingSpec::choice(
        "size_distribution",
        &["normal", "lognormal", "rosin_rammler", "sieve"],
        ALL,
        "distribution of sizes: normal or lognormal radii by number (radius_mean, radius_sd); rosin_rammler: mass finer than d \
         is 1 - exp(-(d/size)^exponent); all three cut as the radii are; sieve: a curve of up to six sieves, by mass",
        "normal: paper, section 3.1",
    )
    .silent(),
    SettingSpec::number(
        "rosin_rammler_size",
        "m",
        (0.011, 1e-4, 0.2),
        ALL,
        "diameter below which 63.2 % of the mass lies",
        ABSENT,
    )
    .silent(),
    SettingSpec::number("rosin_rammler_exponent", "1", (4.0, 0.5, 50.0), ALL, "the larger, the narrower", ABSENT).silent(),
    sieve_size(0),
    sieve_finer(0),
    sieve_size(1),
    sieve_finer(1),
    sieve_size(2),
    sieve_finer(2),
    sieve_size(3),
    sieve_finer(3),
    sieve_size(4),
    sieve_finer(4),
    sieve_size(5),
    sieve_finer(5),
    SettingSpec::number(
        "radius_scale",
        "1",
        (1.0, 0.1, 10.0),
        ALL,
        "factor on every radius (coarse-graining); lengths of the apparatus stay",
        "1 = true size",
    ),
    SettingSpec::number(
        "normal_stiffness",
        "N/m",
        (3.67743e5, 1.0, 1e9),
        ALL,
        "normal stiffness k_p between grains of the mean size at radius_scale 1; k is proportional to \
         the radius (eq. 1)",
        "paper, Table 4 as printed (eq. 1 gives 3.67985e5)",
    ),
    SettingSpec::number(
        "stiffness_scale",
        "1",
        (1.0, 1e-4, 10.0),
        ALL,
        "factor on every stiffness (softening); a damping in kg/s stays as it is, and keeps the restitution \
         only if it is multiplied by the square root of this",
        "1 = true stiffness",
    ),
    SettingSpec::number(
        "wall_stiffness_ratio",
        "1",
        (2.0, 0.1, 10.0),
        ALL,
        "wall stiffness over grain stiffness",
        TABLE_4,
    ),
    SettingSpec::number(
        "sliding_stiffness_ratio",
        "1",
        (2.0 / 7.0, 0.0, 1.0),
        ALL,
        "sliding spring over normal spring",
        TABLE_4,
    ),
    SettingSpec::number(
        "rolling_stiffness_ratio",
        "1",
        (2.0 / 7.0, 0.0, 1.0),
        ALL,
        "rolling spring over normal spring",
        TABLE_4,
    ),
    SettingSpec::number(
        "damping",
        "1",
        (0.3, 0.0, 1.0),
        ALL,
        "damping of the normal, sliding and rolling springs, read as `damping_reading` says",
        TABLE_4,
    ),
    SettingSpec::number(
        "sliding_damping_factor",
        "1",
        (1.0, 0.0, 2.0),
        ALL,
        "sliding dashpot over what `damping` says; 0: none, as in LIGGGHTS with tangential_damping off",
        TABLE_4,
    )
    .silent(),
    SettingSpec::number(
        "rolling_damping_factor",
        "1",
        (1.0, 0.0, 2.0),
        ALL,
        "rolling dashpot over what `damping` says; 0: none, as in LIGGGHTS epsd2",
        TABLE_4,
    )
    .silent(),
    SettingSpec::choice(
        "damping_reading",
        &["pair_ratio", "mean_particle", "per_mass", "constant", "restitution"],
        ALL,
        "pair_ratio: gamma = 2 zeta sqrt(k m_eff) per pair; mean_particle: one gamma, that of the mean \
         grain; per_mass: one gamma/m_eff, that of the mean grain; constant: gamma in kg/s; restitution: \
         e",
        "Table 4 does not say which",
    )
    .assumed(),
    SettingSpec::choice(
        "clip_normal_force",
        &["no", "yes"],
        ALL,
        "whether the normal force may pull late in a rebound (no) or is cut at zero (yes)",
        "MercuryDPM does not clip",
    )
    .assumed(),
    SettingSpec::number(
        "time_step_fraction",
        "1",
        (0.1, 1e-3, 0.2),
        ALL,
        "time step over the collision time of the smallest grain",
        TABLE_3,
    ),
    SettingSpec::number("gravity", "m/s2", (9.81, 0.0, 100.0), ALL, "acceleration of gravity", "standard"),
    SettingSpec::number(
        "tilt",
        "deg",
        (0.0, -20.0, 20.0),
        ALL,
        "the apparatus stands tilted about the front-to-back axis; positive lets grains drift to the right",
        "absent in the paper",
    ),
    SettingSpec::number(
        "bond_number",
        "1",
        (0.0, 0.0, 10.0),
        ALL,
        "capillary force of a mean pair over the weight of a mean grain, 2 pi R gamma cos(theta)/(m g); \
         0 = dry",
        "absent in the paper",
    ),
    SettingSpec::number(
        "liquid_volume_ratio",
        "1",
        (1e-3, 1e-6, 0.05),
        ALL,
        "volume of a liquid bridge over R^3; sets its reach",
        "thin pendular bridges (Willett et al. 2000)",
    )
    .assumed(),
    SettingSpec::number(
        "contact_angle",
        "deg",
        (0.0, 0.0, 80.0),
        ALL,
        "contact angle of the liquid; sets the reach of a bridge",
        "wetting liquid",
    )
    .assumed(),
    SettingSpec::number(
        "wall_bridge_ratio",
        "1",
        (1.0, 0.0, 1.0),
        ALL,
        "force of a liquid bridge to a wall over that to a wall wetted as the grains are; 0 = nothing sticks to walls",
        "cos(theta) of the wall over that of the grains; 1 = both wetted",
    )
    .assumed()
    .silent(),
    SettingSpec::number(
        "wall_friction_acrylic",
        "1",
        (0.446, 0.0, 2.0),
        PLATES,
        "sliding friction on acrylic worn by sliding: pile, ledge, hopper front and back",
        TABLE_1,
    ),
    SettingSpec::number(
        "wall_friction_steel_impact",
        "1",
        (0.523, 0.0, 2.0),
        &["hopper"],
        "sliding friction on steel worn by impact: hopper side walls",
        TABLE_1,
    ),
    SettingSpec::number(
        "wall_friction_steel_sliding",
        "1",
        (0.456, 0.0, 2.0),
        &["bulk_density"],
        "sliding friction on steel worn by sliding: density cylinder",
        TABLE_1,
    ),
    SettingSpec::number(
        "wall_rolling_ratio",
        "1",
        (2.0, 0.0, 10.0),
        ALL,
        "rolling over sliding friction on every wall",
        "paper, section 3.1",
    ),
    SettingSpec::number(
        "front_back_friction_scale",
        "1",
        (1.0, 0.0, 10.0),
        PLATES,
        "factor on the friction of front and back plates; 0 lets a thin slice stand for a wide box",
        "1 = as measured",
    ),
    SettingSpec::number(
        "insertion_step",
        "1",
        (1e-4, 1e-6, 1e-1),
        ALL,
        "rise of the insertion plane per attempted grain over the mean radius",
        "paper, section 3.2; per attempt is our reading",
    )
    .assumed(),
    SettingSpec::number(
        "insertion_ratio",
        "1",
        (0.66, 0.1, 2.0),
        ALL,
        "grain volume inserted over the volume to be filled; the excess is deleted",
        "more than a bed holds, so that every bed is full",
    )
    .assumed(),
    SettingSpec::choice(
        "deletion_reference",
        &["centre", "top"],
        ALL,
        "point of a grain that decides whether it lies above the fill height",
        "MercuryDPM's deletion boundary looks at the centre",
    )
    .assumed(),
    SettingSpec::number(
        "stop_energy_ratio",
        "1",
        (1e-6, 0.0, 1.0),
        ALL,
        "kinetic over elastic energy below which a run stops",
        "paper, section 3.2 (printed the other way round)",
    ),
    SettingSpec::number(
        "insertion_density",
        "1",
        (0.0, 0.0, 0.6),
        ALL,
        "solid fraction of the inserted cloud over the area of insertion; 0: the plane rises by insertion_step",
        "the paper states no density",
    )
    .silent(),
    SettingSpec::choice(
        "waiting",
        &["full", "skipped"],
        ALL,
        "whether grains at rest (stop_energy_ratio) wait until the vessel is struck off and opened (full), or the clock jumps \
         there (skipped)",
        "the paper waits: its Table 5 gives times",
    )
    .silent(),
];
