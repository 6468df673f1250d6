//! A CT series as DICOM writes it: one file a slice, or one enhanced file [dicom2024]. Plain, deflated, or packed by run lengths, JPEG
//! or JPEG 2000.

mod element;
mod frames;
mod rle;
pub(super) mod segmentation;
mod slice;

use super::FormatError;
use meshes::volume::{Grid, Volume};
use meshes::{Point, Vector};
use nalgebra::Matrix3;
use notices::{Kind, Notice};
use slice::Slice;

/// What a series of slices gives.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// The volume, rescaled (Hounsfield units), in the patient's coordinates.
    pub volume: Volume,
    /// Angle between the way the slices are stacked and their normal: the gantry's tilt [deg].
    pub tilt_deg: f64,
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
}

/// Two slices nearer than this lie at one place [mm].
const SAME_PLACE: f64 = 1e-3;
/// Slices may lie this share of their spacing off an even stack [-].
const UNEVEN: f64 = 0.1;

fn refuse<T>(what: impl Into<String>) -> Result<T, FormatError> {
    Err(FormatError(what.into()))
}

/// Whether a file says that it is DICOM.
pub fn looks_dicom(bytes: &[u8]) -> bool {
    bytes.get(128..132) == Some(b"DICM")
}

/// Reads a series from its files by name, in any order.
///
/// Slices are sorted by their position along their normal and checked to be an even stack; rescale slope and intercept are
/// applied; a tilted gantry's slices keep their places, sheared. Files that are no DICOM and pictures of another kind
/// (localisers) are left out with a warning; a slice twice with the same content too.
///
/// # Errors
/// A damaged file, a compression we do not read, several series, a missing slice, two different slices at one place, uneven or sideways
/// shifted slices: with the files' names.
pub fn read_series(files: &[(&str, &[u8])]) -> Result<Series, FormatError> {
    let (Survey { grid, tilt_deg, warnings, .. }, slices) = stack(files, Pixels::Unpacked)?;
    let mut values = Vec::new();
    for slice in &slices {
        slice.values(&mut values).map_err(|e| FormatError(format!("{}: {}", slice.name, e.0)))?;
    }
    Ok(Series { volume: Volume { grid, values }, tilt_deg, warnings })
}

/// What the headers of a series say.
#[derive(Clone, Debug, PartialEq)]
pub struct Survey {
    /// Where its voxels will lie.
    pub grid: Grid,
    /// The gantry's tilt [deg].
    pub tilt_deg: f64,
    /// Which way its slices are cut: axial, coronal or sagittal, and oblique where they stand between.
    pub cut: &'static str,
    /// Its kind of picture as the file says it (CT); empty where it does not.
    pub modality: String,
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
}

/// What [`read_series`] would find, from the headers alone: no pixel is unpacked.
///
/// # Errors
/// As [`read_series`], but for damaged pixels.
pub fn survey(files: &[(&str, &[u8])]) -> Result<Survey, FormatError> {
    stack(files, Pixels::AsTheyAre).map(|(survey, _)| survey)
}

/// Whether pixels are wanted as numbers.
#[derive(Clone, Copy, PartialEq)]
enum Pixels {
    Unpacked,
    /// As the file has them, to see whether two slices are one.
    AsTheyAre,
}

/// Axes that lie this near the body's are along them [-]: the cosine of 20 deg, a common tilt of a positioned leg.
const ALONG: f64 = 0.94;

/// The cut of slices with this normal.
fn cut(normal: &Vector) -> &'static str {
    match (normal.iamax(), normal.amax() >= ALONG) {
        (0, true) => "sagittal",
        (1, true) => "coronal",
        (2, true) => "axial",
        (0, false) => "sagittal, oblique",
        (1, false) => "coronal, oblique",
        _ => "axial, oblique",
    }
}

/// The one series of the files, sorted and checked.
fn stack<'a>(files: &[(&'a str, &'a [u8])], pixels: Pixels) -> Result<(Survey, Vec<Slice<'a>>), FormatError> {
    let mut warnings = Vec::new();
    let mut slices = Vec::new();
    let mut strangers = Vec::new();
    for &(name, bytes) in files {
        if !looks_dicom(bytes) {
            strangers.push(name);
            continue;
        }
        let read = slice::read(name, bytes, pixels).map_err(|e| FormatError(format!("{name}: {}", e.0)))?;
        if read.is_empty() {
            strangers.push(name);
        }
        slices.extend(read);
    }
    if !strangers.is_empty() {
        warnings.push(
            Kind::StrangeFiles
                .notice(format!(
                    "{} of {} files are no slices and left out, {} first",
                    strangers.len(),
                    files.len(),
                    strangers[0]
                ))
                .count(strangers.len()),
        );
    }
    let mut slices = one_series(slices, &mut warnings)?;
    let Some(first) = slices.first() else {
        return refuse(format!("none of {} files is a slice; expected a DICOM series, one file a slice", files.len()));
    };
    let normal = first.normal();
    slices.sort_by(|a, b| {
        let along = |s: &Slice| normal.dot(&s.position.coords);
        along(a).total_cmp(&along(b)).then(a.name.cmp(b.name))
    });
    without_doubles(&mut slices, &normal, &mut warnings)?;
    if slices.len() < 3 {
        return refuse(format!("{} slices; expected a series through the whole knee, a hundred or more", slices.len()));
    }
    let step = even_stack(&slices, &normal)?;
    let tilt_deg = step.angle(&normal).to_degrees();
    if tilt_deg > 0.5 {
        warnings.push(
            Kind::TiltedGantry
                .notice(format!("the gantry was tilted by {tilt_deg:.1} degrees; the slices are placed accordingly")),
        );
    }
    let first = &slices[0];
    let grid = Grid {
        size: [first.columns, first.rows, slices.len()],
        origin: first.position,
        axes: Matrix3::from_columns(&[first.along_row * first.pixel[1], first.along_column * first.pixel[0], step]),
    };
    if grid.count() > super::nifti::MOST_VOXELS {
        return refuse(format!(
            "{:?} voxels are more than {}; crop the picture to the knee",
            grid.size,
            super::nifti::MOST_VOXELS
        ));
    }
    let modality = first.modality.clone();
    Ok((Survey { grid, tilt_deg, cut: cut(&normal), modality, warnings }, slices))
}

/// The slices of the one series there is; pictures of another size or direction that are few are left out.
fn one_series<'a>(slices: Vec<Slice<'a>>, warnings: &mut Vec<Notice>) -> Result<Vec<Slice<'a>>, FormatError> {
    let mut groups: Vec<Vec<Slice>> = Vec::new();
    for slice in slices {
        match groups.iter_mut().find(|g| g[0].goes_with(&slice)) {
            Some(group) => group.push(slice),
            None => groups.push(vec![slice]),
        }
    }
    groups.sort_by_key(|g| std::cmp::Reverse(g.len()));
    if let [a, b, ..] = groups.as_slice()
        && 4 * b.len() > a.len()
    {
        return refuse(format!(
            "several series in one folder: {} slices like {}, {} like {}; expected one: keep the series of the knee with the thinnest slices",
            a.len(),
            a[0].name,
            b.len(),
            b[0].name
        ));
    }
    for group in groups.iter().skip(1) {
        warnings.push(
            Kind::OtherPictures
                .notice(format!("{} pictures of another kind are left out, {} first", group.len(), group[0].name))
                .count(group.len()),
        );
    }
    Ok(groups.into_iter().next().unwrap_or_default())
}

fn without_doubles(slices: &mut Vec<Slice>, normal: &Vector, warnings: &mut Vec<Notice>) -> Result<(), FormatError> {
    let mut k = 1;
    let mut doubled = 0;
    while k < slices.len() {
        let (a, b) = (&slices[k - 1], &slices[k]);
        if normal.dot(&(b.position - a.position)).abs() >= SAME_PLACE {
            k += 1;
        } else if a.same_picture(b) {
            doubled += 1;
            if doubled == 1 {
                warnings.push(
                    Kind::DoubledSlices.notice(format!("{} repeats {}; doubled slices are left out", b.name, a.name)),
                );
            }
            slices.remove(k);
        } else {
            return refuse(format!(
                "{} and {} are two different slices at the same place; expected one: separate the phases or reconstructions",
                a.name, b.name
            ));
        }
    }
    Ok(())
}

/// The step from slice to slice.
fn even_stack(slices: &[Slice], normal: &Vector) -> Result<Vector, FormatError> {
    let n = slices.len();
    let gap = |k: usize| normal.dot(&(slices[k + 1].position - slices[k].position));
    let mut gaps: Vec<f64> = (0..n - 1).map(gap).collect();
    gaps.sort_by(f64::total_cmp);
    let usual = gaps[gaps.len() / 2];
    for k in 0..n - 1 {
        let (a, b) = (slices[k].name, slices[k + 1].name);
        if gap(k) > 1.5 * usual {
            let missing = (gap(k) / usual).round() - 1.0;
            return refuse(format!(
                "{missing} slices are missing between {a} and {b}: they lie {:.2} mm apart, others {usual:.2} mm; export the whole series",
                gap(k)
            ));
        }
        if (gap(k) - usual).abs() > UNEVEN * usual {
            return refuse(format!(
                "slices {a} and {b} lie {:.3} mm apart, others {usual:.3} mm; expected an even stack: export one reconstruction",
                gap(k)
            ));
        }
    }
    let step = (slices[n - 1].position - slices[0].position) / (n - 1) as f64;
    let pixel = slices[0].pixel[0].min(slices[0].pixel[1]);
    for (k, slice) in slices.iter().enumerate() {
        let off: Vector = slice.position - (slices[0].position + step * k as f64);
        if (off - normal * normal.dot(&off)).norm() > 0.25 * pixel {
            return refuse(format!(
                "{} lies {:.2} mm sideways of the stack; expected slices in one line",
                slice.name,
                off.norm()
            ));
        }
    }
    Ok(step)
}

/// A point from three numbers.
fn point(x: &[f64]) -> Option<Point> {
    (x.len() == 3 && x.iter().all(|x| x.is_finite() && x.abs() < 1e6)).then(|| Point::new(x[0], x[1], x[2]))
}

#[cfg(test)]
mod tests;
