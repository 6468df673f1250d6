//! Registration: as supplied, and under drawn errors, poses and coverage.

use crate::knees::{Knee, user_seconds};
use crate::page::{Limit, Section};
use crate::registration::{Case, Noise, apart, exact_twin, noisy, part, random_pose, seeded};
use meshes::surface::{ColouredMesh, TriMesh};
use meshes::{Isometry, Vector};
use stages::register::{RegisterOptions, register_bone};

/// Poses without landmarks, of all bones together.
const POSES: usize = 50;

/// Whether true errors lie from a half to twice the predicted ones, by kind of case.
#[derive(Default)]
struct Grades(Vec<(&'static str, Vec<bool>)>);

impl Grades {
    fn add(&mut self, kind: &'static str, error: f64, predicted: f64) {
        let within = error < 2.0 * predicted && predicted < 2.0 * error;
        match self.0.iter_mut().find(|g| g.0 == kind) {
            Some(group) => group.1.push(within),
            None => self.0.push((kind, vec![within])),
        }
    }
}

struct Found {
    error: f64,
    angle: f64,
    predicted: f64,
    seconds: f64,
}

fn found(of: &Case) -> Option<Found> {
    let start = user_seconds();
    let result = register_bone(&of.ct, &of.scan, &of.pairs, &RegisterOptions::default()).ok()?;
    let seconds = user_seconds() - start;
    let (error, angle) = apart(result.ct_from_scan.motion(), &of.truth, &of.scan.mesh);
    Some(Found { error, angle, predicted: result.predicted_error_mm, seconds })
}

fn moved(of: &Case, seed: u64) -> Case {
    let pose = random_pose(&mut seeded(seed));
    let mut of = of.clone();
    of.scan.mesh = of.scan.mesh.moved(&pose);
    of.truth *= pose.inverse();
    of.pairs.iter_mut().for_each(|p| p.0 = pose * p.0);
    of
}

pub(crate) fn sections(knees: &[Knee]) -> [Section; 2] {
    let mut page = Section::new(
        "Register",
        "Errors are means over the scan's vertices against the truth. White error: all errors of the CT but the drawn one are \
         taken away. Time: user time of all threads.",
    );
    let mut grades = Grades::default();
    let bones: Vec<(String, Case)> =
        knees.iter().flat_map(|k| ["femur", "tibfib"].map(|b| (format!("{} {b}", k.name), k.case(b)))).collect();
    for (k, (name, of)) in bones.iter().enumerate() {
        supplied(&mut page, &mut grades, name, of);
        white(&mut page, &mut grades, name, of);
        covered(&mut page, &mut grades, name, of, k);
        for (seed, noise) in
            [Noise::Matern(2.5, 0.1, 7.0), Noise::Matern(1.5, 0.1, 8.0), Noise::Smooth(0.1, 8.0)].iter().enumerate()
        {
            let of = with_noise(of, *noise, 100 * k as u64 + seed as u64);
            if let Some(f) = found(&of) {
                page.add(
                    "mean error, correlated CT error of 0.1 mm over 7 to 8 mm [mm]",
                    Limit::Most(0.06),
                    name,
                    f.error,
                );
                grades.add("correlated error of the CT", f.error, f.predicted);
            }
        }
    }
    posed(&mut page, &mut grades, &bones);
    refused(&mut page, &bones);
    [page, graded(&grades)]
}

fn supplied(page: &mut Section, grades: &mut Grades, name: &str, of: &Case) {
    let Some(f) = found(of) else {
        page.add("mean error as supplied [mm]", Limit::Most(0.06), name, f64::NAN);
        return;
    };
    page.add("mean error as supplied [mm]", Limit::Most(0.06), name, f.error);
    page.add("rotation as supplied [deg]", Limit::Most(0.09), name, f.angle);
    page.add("time with landmarks [s]", Limit::Most(0.6), name, f.seconds);
    grades.add("as supplied", f.error, f.predicted);
}

/// The case with an error of its own.
fn with_noise(of: &Case, noise: Noise, seed: u64) -> Case {
    let mut rng = seeded(1000 + seed);
    let mut of = exact_twin(of, 0.058, &mut rng);
    of.ct = noisy(&of.ct, noise, &mut rng);
    of
}

fn white(page: &mut Section, grades: &mut Grades, name: &str, of: &Case) {
    for seed in 0..2 {
        let Some(f) = found(&with_noise(of, Noise::White(0.05), seed)) else {
            page.add("mean error, white CT error of 0.05 mm [mm]", Limit::Most(0.03), name, f64::NAN);
            continue;
        };
        page.add("mean error, white CT error of 0.05 mm [mm]", Limit::Most(0.03), name, f.error);
        page.add("rotation, white CT error of 0.05 mm [deg]", Limit::Most(0.03), name, f.angle);
        grades.add("white error of the CT", f.error, f.predicted);
    }
}

fn covered(page: &mut Section, grades: &mut Grades, name: &str, of: &Case, k: usize) {
    for turn in 0..3 {
        let direction = random_pose(&mut seeded(7000 + 10 * k as u64 + turn)).rotation * Vector::x();
        let few = Case { scan: part(&of.scan, &direction, 0.4), ..of.clone() };
        let f = found(&few);
        let error = f.as_ref().map_or(f64::NAN, |f| f.error);
        page.add(
            "mean error, 40 % of the scan missing [mm]",
            Limit::Most(0.2),
            &format!("{name} direction {turn}"),
            error,
        );
        if let Some(f) = f {
            grades.add("40 % of the scan missing", f.error, f.predicted);
        }
    }
}

fn posed(page: &mut Section, grades: &mut Grades, bones: &[(String, Case)]) {
    let mut right = 0;
    for k in 0..POSES {
        let (name, of) = &bones[k % bones.len()];
        let of = Case { pairs: Vec::new(), ..moved(of, k as u64) };
        let Some(f) = found(&of) else { continue };
        right += usize::from(f.error < 0.3 && f.angle < 0.5);
        page.add("time without landmarks [s]", Limit::Most(0.6), &format!("{name} pose {k}"), f.seconds);
        grades.add("any pose, no landmarks", f.error, f.predicted);
    }
    page.add(
        "right within 0.3 mm and 0.5 deg from any pose without landmarks",
        Limit::Least(POSES as f64),
        "all bones",
        right as f64,
    );
}

fn refused(page: &mut Section, bones: &[(String, Case)]) {
    let mut taken = |what: String, ct: &TriMesh, scan: &ColouredMesh| {
        let result = register_bone(ct, scan, &[], &RegisterOptions::default());
        page.add("wrong bones taken", Limit::Most(0.0), &what, f64::from(u8::from(result.is_ok())));
    };
    for (k, (name, of)) in bones.iter().enumerate() {
        let mut mirrored = of.scan.clone();
        mirrored.mesh.vertices.iter_mut().for_each(|p| p.x = -p.x);
        mirrored.mesh = mirrored.mesh.flipped();
        taken(format!("{name} mirrored"), &of.ct, &mirrored);
        // The same bone of the next knee, and the other bone of this one.
        for other in [(k + 2) % bones.len(), k ^ 1] {
            let (theirs, scan) = &bones[other];
            taken(format!("{theirs} on {name}"), &of.ct, &scan.scan);
        }
    }
}

fn graded(grades: &Grades) -> Section {
    let mut page = Section::new(
        "Self-grading",
        "Share of the registrations above whose true error lies from a half to twice the predicted one, by kind.",
    );
    let share = |of: &[bool]| of.iter().filter(|w| **w).count() as f64 / of.len().max(1) as f64;
    for (kind, within) in &grades.0 {
        page.add(
            "share of a kind within a factor of 2",
            Limit::Least(0.9),
            &format!("{kind} ({})", within.len()),
            share(within),
        );
    }
    let all: Vec<bool> = grades.0.iter().flat_map(|g| g.1.clone()).collect();
    page.add("share of all within a factor of 2", Limit::Least(0.9), "all", share(&all));
    page
}

/// A motion whose parts are all large.
pub(crate) fn far() -> Isometry {
    Isometry::new(Vector::new(310.0, -42.0, 77.0), Vector::new(0.9, -1.7, 0.4))
}
