//! The outline of a heap as a camera sees it, and the line laid through it (paper, section 3.3, Fig. 8).
//!
//! Takes the grains of a final state; gives angle, roughness and bow of the slope within a window of x. A window is
//! cut into bins one mean diameter wide, the grain with the highest z + r of each bin is marked, and a line is fitted
//! to the marks. Which grains are looked at is the operator: the front layer (the paper's), every depth slice one
//! diameter thick (mean of the angles), or the silhouette over the whole depth. Deliberately knows no experiment.

use super::reason::Reason;
use crate::dem::State;
use crate::settings::Settings;

/// Degrees per radian.
pub const DEGREES: f64 = 180.0 / std::f64::consts::PI;

/// One grain in the picture; x to the right, y away from the camera, z up [m].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grain {
    /// Centre, to the right [m].
    pub x: f64,
    /// Centre, distance from the front plate [m].
    pub y: f64,
    /// Centre, upwards [m].
    pub z: f64,
    /// Radius [m].
    pub radius: f64,
}

impl Grain {
    /// Highest point z + r [m].
    pub fn top(&self) -> f64 {
        self.z + self.radius
    }
}

/// Range of x in which a slope is measured [m].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Start [m].
    pub from: f64,
    /// End [m].
    pub to: f64,
}

impl Window {
    fn contains(&self, x: f64) -> bool {
        (self.from..self.to).contains(&x)
    }
}

/// A line through an outline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slope {
    /// Angle to the horizontal, positive where the outline rises with x [deg].
    pub angle: f64,
    /// Residual standard deviation of the marks about the line, n − 2 degrees of freedom [m].
    pub roughness: f64,
    /// Change of the slope dz/dx from start to end of the window by the fitted parabola, positive where hollow [1].
    pub bow: f64,
}

/// Which grains count and how a window is cut: the operator of the camera and the analyst.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    layers: Vec<(f64, f64)>,
    diameter: f64,
    bin_width: f64,
    empty_bins: EmptyBins,
    bins_needed: usize,
    roll: f64,
    streak_speed: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum EmptyBins {
    Skip,
    Floor,
    Refuse,
}

impl EmptyBins {
    fn new(settings: &Settings) -> Self {
        if settings.is("empty_bins", "floor") {
            Self::Floor
        } else if settings.is("empty_bins", "refuse") {
            Self::Refuse
        } else {
            Self::Skip
        }
    }
}

impl View {
    /// The view that the settings describe, of a box `depth` metres deep with grains `scale` times their true size.
    pub fn new(settings: &Settings, depth: f64, scale: f64) -> Self {
        let diameter = 2.0 * settings["nominal_radius"] * scale;
        Self {
            layers: layers(settings, depth, diameter),
            diameter,
            bin_width: settings["bin_width"] * diameter,
            empty_bins: EmptyBins::new(settings),
            bins_needed: settings["bins_needed"] as usize,
            roll: settings["camera_roll"] / DEGREES,
            streak_speed: settings["streak_speed"],
        }
    }

    /// Mean diameter the analyst believes in [m].
    pub fn diameter(&self) -> f64 {
        self.diameter
    }

    /// The grains of `state` that are not in flight, in a picture rolled counter-clockwise by the camera roll:
    /// x' = x cos δ − z sin δ, z' = x sin δ + z cos δ.
    pub fn picture(&self, state: &State) -> Vec<Grain> {
        let (sine, cosine) = (libm::sin(self.roll), libm::cos(self.roll));
        let speed = |i: usize| {
            let (u, v, w) = (state.vx[i], state.vy[i], state.vz[i]);
            (u * u + v * v + w * w).sqrt()
        };
        (0..state.len())
            .filter(|i| speed(*i) <= self.streak_speed)
            .map(|i| Grain {
                x: state.x[i] * cosine - state.z[i] * sine,
                y: state.y[i],
                z: state.x[i] * sine + state.z[i] * cosine,
                radius: state.radius[i],
            })
            .collect()
    }

    /// Slope within `window`: the mean over the layers of the view that give one.
    ///
    /// # Errors
    /// The reason of the first layer, where no layer gives a slope.
    pub fn slope(&self, grains: &[Grain], window: Window) -> Result<Slope, Reason> {
        if window.to <= window.from {
            return Err(Reason::EmptyWindow { from: window.from, to: window.to });
        }
        let slopes: Vec<_> = self.layers.iter().map(|layer| self.layer_slope(grains, *layer, window)).collect();
        let given: Vec<Slope> = slopes.iter().filter_map(|slope| slope.as_ref().ok().copied()).collect();
        match (given.is_empty(), slopes.into_iter().find_map(Result::err)) {
            (true, Some(reason)) => Err(reason),
            _ => Ok(mean_slope(&given)),
        }
    }

    /// Highest point of the outline within `window`: the mean over the layers that hold a grain there [m].
    ///
    /// # Errors
    /// [`Reason::NoGrains`] where no layer holds one.
    pub fn height(&self, grains: &[Grain], window: Window) -> Result<f64, Reason> {
        let tops: Vec<f64> =
            self.layers.iter().filter_map(|layer| highest(grains, *layer, window)).map(|grain| grain.top()).collect();
        if tops.is_empty() {
            return Err(Reason::NoGrains);
        }
        Ok(mean(tops.iter().copied(), tops.len()))
    }

    fn layer_slope(&self, grains: &[Grain], layer: (f64, f64), window: Window) -> Result<Slope, Reason> {
        let marks = self.marks(grains, layer, window)?;
        if marks.len() < self.bins_needed {
            return Err(Reason::TooFewBins { filled: marks.len(), needed: self.bins_needed });
        }
        Ok(line(&marks, window.to - window.from))
    }

    /// The marks (x, z + r) of the highest grain of each bin; as many bins as diameters in the window, rounded up.
    fn marks(&self, grains: &[Grain], layer: (f64, f64), window: Window) -> Result<Vec<(f64, f64)>, Reason> {
        let bins = ((window.to - window.from) / self.bin_width).ceil() as usize;
        let width = (window.to - window.from) / bins as f64;
        let mut marks = Vec::with_capacity(bins);
        for bin in 0..bins {
            let from = window.from + bin as f64 * width;
            let mark = highest(grains, layer, Window { from, to: from + width }).map(|grain| (grain.x, grain.top()));
            match (mark, self.empty_bins) {
                (Some(mark), _) => marks.push(mark),
                (None, EmptyBins::Floor) => marks.push((from + 0.5 * width, 0.0)),
                (None, EmptyBins::Refuse) => return Err(Reason::EmptyBin { bin: bin + 1, bins }),
                (None, EmptyBins::Skip) => {}
            }
        }
        Ok(marks)
    }
}

/// Ranges of y the view looks at, one after the other.
fn layers(settings: &Settings, depth: f64, diameter: f64) -> Vec<(f64, f64)> {
    if settings.is("slope_operator", "slices") {
        slices(depth, settings["slice_thickness"] * diameter)
    } else if settings.is("slope_operator", "silhouette") {
        vec![(f64::NEG_INFINITY, f64::INFINITY)]
    } else {
        vec![(f64::NEG_INFINITY, settings["front_layer"] * diameter)]
    }
}

/// As many equal slices as whole thicknesses in the depth, at least one; the outer ones have no outer bound, because a
/// grain pressed against a plate overlaps it.
fn slices(depth: f64, thickness: f64) -> Vec<(f64, f64)> {
    let count = ((depth / thickness) as usize).max(1);
    let edge = |i: usize| match i {
        0 => f64::NEG_INFINITY,
        i if i == count => f64::INFINITY,
        i => depth * i as f64 / count as f64,
    };
    (0..count).map(|i| (edge(i), edge(i + 1))).collect()
}

/// The grain with the highest z + r in layer and window; the first of equals.
fn highest(grains: &[Grain], layer: (f64, f64), window: Window) -> Option<&Grain> {
    grains
        .iter()
        .filter(|grain| (layer.0..layer.1).contains(&grain.y) && window.contains(grain.x))
        .reduce(|best, grain| if grain.top() > best.top() { grain } else { best })
}

/// Least squares through at least three marks with distinct x: line, its residual scatter, and the parabola's bow.
///
/// With u = x − x̄: b = Σuz/Σu²; the parabola's term is q = u² − mean(u²) − u Σu³/Σu², orthogonal to 1 and u, with
/// coefficient c = Σqz/Σq², so that dz/dx changes by 2 c L over a window of length L.
fn line(marks: &[(f64, f64)], length: f64) -> Slope {
    let n = marks.len();
    let x_mean = mean(marks.iter().map(|mark| mark.0), n);
    let z_mean = mean(marks.iter().map(|mark| mark.1), n);
    let centred: Vec<(f64, f64)> = marks.iter().map(|(x, z)| (x - x_mean, z - z_mean)).collect();
    let sum = |term: &dyn Fn(f64, f64) -> f64| centred.iter().map(|(u, w)| term(*u, *w)).sum::<f64>();
    let squares = sum(&|u, _| u * u);
    let b = sum(&|u, w| u * w) / squares;
    let scatter = sum(&|u, w| (w - b * u) * (w - b * u));
    let (level, skew) = (squares / n as f64, sum(&|u, _| u * u * u) / squares);
    let q = |u: f64| u * u - level - skew * u;
    let c = sum(&|u, w| q(u) * w) / sum(&|u, _| q(u) * q(u));
    Slope { angle: DEGREES * libm::atan(b), roughness: (scatter / (n - 2) as f64).sqrt(), bow: 2.0 * c * length }
}

fn mean_slope(slopes: &[Slope]) -> Slope {
    let average = |part: &dyn Fn(&Slope) -> f64| mean(slopes.iter().map(part), slopes.len());
    Slope { angle: average(&|s| s.angle), roughness: average(&|s| s.roughness), bow: average(&|s| s.bow) }
}

fn mean(values: impl Iterator<Item = f64>, count: usize) -> f64 {
    values.sum::<f64>() / count as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEPTH: f64 = 0.1;

    fn view(changes: &[(&str, &str)]) -> View {
        let mut settings = Settings::default();
        changes.iter().for_each(|(name, value)| settings.set_text(name, value).unwrap());
        View::new(&settings, DEPTH, 1.0)
    }

    /// Grains of radius 1 mm on a grid of 1 mm, whose tops lie on z = height(x).
    fn sheet(height: impl Fn(f64) -> f64) -> Vec<Grain> {
        let column = |x: f64| (0..100).map(move |j| (x, f64::from(j) * 1e-3 + 0.5e-3));
        (-100..100)
            .flat_map(|i| column(f64::from(i) * 1e-3 + 0.5e-3))
            .map(|(x, y)| Grain { x, y, z: height(x) - 1e-3, radius: 1e-3 })
            .collect()
    }

    #[test]
    fn every_operator_measures_a_slope_of_known_angle() {
        for angle in [-40.0, -10.0, 0.0, 25.0, 45.0_f64] {
            let grains = sheet(|x| 0.2 + x * libm::tan(angle / DEGREES));
            for operator in ["front", "slices", "silhouette"] {
                let slope =
                    view(&[("slope_operator", operator)]).slope(&grains, Window { from: -0.09, to: 0.0 }).unwrap();
                // All marks lie on the line itself, so only rounding is left.
                assert!((slope.angle - angle).abs() < 1e-9, "{operator} {angle}: {}", slope.angle);
                assert!(slope.roughness < 1e-12 && slope.bow.abs() < 1e-9, "{operator} {angle}");
            }
        }
    }

    #[test]
    fn the_bow_is_the_change_of_slope_of_a_parabola() {
        // z = 3 x² changes its slope by 6 L over a window of length L.
        let grains = sheet(|x| 3.0 * x * x);
        let slope = view(&[]).slope(&grains, Window { from: -0.09, to: 0.0 }).unwrap();
        assert!((slope.bow - 0.54).abs() < 1e-9, "{}", slope.bow);
    }

    #[test]
    fn roughness_is_the_scatter_about_the_line() {
        // Marks alternate ±1 mm about a level line over 9 bins of one diameter: 5 above, 4 below.
        let diameter = 2.0 * 5.02e-3;
        let grains: Vec<Grain> = (0..9)
            .map(|i| Grain {
                x: (f64::from(i) + 0.5) * diameter,
                y: 0.0,
                z: 0.1 + if i % 2 == 0 { 1e-3 } else { -1e-3 },
                radius: 5.02e-3,
            })
            .collect();
        let slope = view(&[]).slope(&grains, Window { from: 0.0, to: 9.0 * diameter }).unwrap();
        // Σ(±1)² minus the mean's part: 9 − 9 (1/9)² = 80/9 mm², slope 0 by symmetry, 7 degrees of freedom.
        let expected = 1e-3 * (80.0 / 9.0 / 7.0_f64).sqrt();
        assert!((slope.roughness - expected).abs() < 1e-12, "{} {expected}", slope.roughness);
        assert!(slope.angle.abs() < 1e-9);
    }

    #[test]
    fn the_front_operator_sees_only_the_front_layer() {
        let mut grains = sheet(|x| 0.2 + x);
        grains.iter_mut().filter(|grain| grain.y > 0.02).for_each(|grain| grain.z += 0.1 * grain.x);
        let window = Window { from: -0.09, to: 0.0 };
        let angle = |operator| view(&[("slope_operator", operator)]).slope(&grains, window).unwrap().angle;
        assert!((angle("front") - 45.0).abs() < 1e-9);
        // Slices from 0 to 20 mm see 45 degrees, the other eight of ten see atan 1.1.
        let mixed = (2.0 * 45.0 + 8.0 * DEGREES * libm::atan(1.1)) / 10.0;
        assert!(
            (view(&[("slope_operator", "slices"), ("nominal_radius", "0.005")]).slope(&grains, window).unwrap().angle
                - mixed)
                .abs()
                < 1e-9
        );
        // Left of x = 0 the added part is negative, so the front layer makes the silhouette.
        assert!((angle("silhouette") - 45.0).abs() < 1e-9);
    }

    #[test]
    fn a_rolled_camera_shifts_the_angle_by_the_roll() {
        let view = view(&[("camera_roll", "2"), ("slope_operator", "slices")]);
        let grains = sheet(|x| 0.2 + x * libm::tan(25.0 / DEGREES));
        let mut state = State::default();
        for grain in &grains {
            state.x.push(grain.x);
            state.y.push(grain.y);
            state.z.push(grain.z);
            state.radius.push(grain.radius);
            [&mut state.vx, &mut state.vy, &mut state.vz].into_iter().for_each(|array| array.push(0.0));
        }
        let slope = view.slope(&view.picture(&state), Window { from: -0.05, to: 0.05 }).unwrap();
        // The centres are rolled by exactly 2 degrees, and z + r lifts all marks alike.
        assert!((slope.angle - 27.0).abs() < 1e-9, "{}", slope.angle);
    }

    #[test]
    fn empty_bins_are_skipped_floored_or_refused_as_set() {
        let window = Window { from: -0.09, to: 0.0 };
        let mut grains = sheet(|x| 0.1 + x);
        grains.retain(|grain| grain.x > -0.06);
        let slope = |grains: &[Grain], rule| view(&[("empty_bins", rule)]).slope(grains, window);
        assert!((slope(&grains, "skip").unwrap().angle - 45.0).abs() < 1e-9);
        assert!(slope(&grains, "floor").unwrap().angle > 45.0);
        assert_eq!(slope(&grains, "refuse").unwrap_err(), Reason::EmptyBin { bin: 1, bins: 9 });
        grains.retain(|grain| grain.x > -0.02);
        assert_eq!(slope(&grains, "skip").unwrap_err(), Reason::TooFewBins { filled: 2, needed: 3 });
        assert_eq!(view(&[]).slope(&grains, Window { from: 0.1, to: 0.05 }).unwrap_err().code(), "empty_window");
        assert_eq!(view(&[]).slope(&[], window).unwrap_err().code(), "too_few_bins");
        assert_eq!(view(&[]).height(&[], window).unwrap_err().code(), "no_grains");
    }

    #[test]
    fn slices_are_one_diameter_thick_and_miss_no_grain() {
        let count = |depth: f64| slices(depth, 0.02).len();
        assert_eq!([count(0.1), count(0.05), count(0.015)], [5, 2, 1]);
        let layers = slices(0.06, 0.02);
        assert_eq!((layers[0].0, layers[2].1), (f64::NEG_INFINITY, f64::INFINITY));
        assert!(layers.windows(2).all(|pair| pair[0].1 == pair[1].0));
    }
}
