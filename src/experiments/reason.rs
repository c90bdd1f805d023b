//! Why an observable cannot be given: a fixed vocabulary, so that a table can be searched for it.

/// A typed reason in the place of a value.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Reason {
    /// Nothing is left to be measured.
    #[error("no grain is left to be measured")]
    NoGrains,
    /// A bin of the angle window holds no grain and `empty_bins` says refuse.
    #[error("bin {bin} of {bins} of the angle window holds no grain; widen the bins or set `empty_bins`")]
    EmptyBin {
        /// The first empty bin, from 1.
        bin: usize,
        /// Bins in the window.
        bins: usize,
    },
    /// The regression has too few points.
    #[error("only {filled} bins of the angle window hold a grain, {needed} are needed")]
    TooFewBins {
        /// Bins with a grain.
        filled: usize,
        /// Bins needed, as set.
        needed: usize,
    },
    /// The angle window has no width: it starts behind its end.
    #[error("the angle window from {from} m to {to} m has no width")]
    EmptyWindow {
        /// Start of the window [m].
        from: f64,
        /// End of the window [m].
        to: f64,
    },
    /// The heap leans on a side wall, so its angle is not free.
    #[error("the heap leans on a side wall at x = {x} m; widen the lower box")]
    SlopeReachesWall {
        /// Where it does [m].
        x: f64,
    },
    /// Too little left the opening.
    #[error("the opening clogged after {share} of the mass; scale the opening or use finer grains")]
    Clogged {
        /// Discharged share of the mass at release.
        share: f64,
    },
    /// An arch of grains stands over the opening, so the material did not flow out freely.
    #[error("an arch of {mass:.4} kg stands over the slot; widen the slot or use finer grains")]
    Arched {
        /// Mass over the middle of the slot [kg].
        mass: f64,
    },
    /// The trace has too few samples in the steady part.
    #[error("only {samples} samples of mass lie in the steady flow, {needed} are needed; shorten the trace interval")]
    NoSteadyFlow {
        /// Samples found.
        samples: usize,
        /// Samples needed, as set.
        needed: usize,
    },
    /// The run holds no trace after the release.
    #[error("the run holds no trace of mass after the release")]
    NoTrace,
}

impl Reason {
    /// Stable word for tables and queries.
    pub fn code(&self) -> &'static str {
        match self {
            Self::NoGrains => "no_grains",
            Self::EmptyBin { .. } => "empty_bin",
            Self::TooFewBins { .. } => "too_few_bins",
            Self::EmptyWindow { .. } => "empty_window",
            Self::SlopeReachesWall { .. } => "slope_reaches_wall",
            Self::Clogged { .. } => "clogged",
            Self::Arched { .. } => "arched",
            Self::NoSteadyFlow { .. } => "no_steady_flow",
            Self::NoTrace => "no_trace",
        }
    }
}
