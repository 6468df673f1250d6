//! Left mirrors right: the same data of the mirror image of a knee get the same answer.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::shared;
use calibration::options::CalibrateOptions;
use decks::ImportedDeck;
use diagnosis::diagnosis::{Calibration, Diagnosis, diagnose};
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::problem::trial::Source;
use diagnosis::search::DiagnosisOptions;
use meshes::frame::{AnatomicalFrame, Side};
use meshes::{Point, Vector};
use needs_shared::needs_shared;
use sim::mesh::MeshValue;
use std::path::Path;

fn point(p: Point) -> Point {
    Point::new(-p.x, p.y, p.z)
}

fn vector(v: Vector) -> Vector {
    Vector::new(-v.x, v.y, v.z)
}

fn frame(f: &AnatomicalFrame) -> AnatomicalFrame {
    AnatomicalFrame {
        origin: point(f.origin),
        medial: vector(f.medial),
        anterior: vector(f.anterior),
        superior: vector(f.superior),
    }
}

/// The knee of the other side.
pub(crate) fn mirrored(mut deck: ImportedDeck) -> ImportedDeck {
    let spec = &mut deck.spec;
    spec.side = if spec.side == Side::Left { Side::Right } else { Side::Left };
    spec.frames.femur = frame(&spec.frames.femur);
    spec.frames.tibia = frame(&spec.frames.tibia);
    for axis in spec.frames.chain.iter_mut().flat_map(|c| [&mut c.si, &mut c.ap, &mut c.ml]) {
        axis.point = point(axis.point);
        axis.direction = vector(axis.direction);
    }
    for fibre in &mut spec.fibres {
        fibre.femur = point(fibre.femur);
        fibre.tibia = point(fibre.tibia);
    }
    for mesh in deck.meshes.values_mut() {
        // rigid contact knows surfaces alone
        if let MeshValue::Surface(surface) = mesh {
            surface.vertices.iter_mut().for_each(|p| *p = point(*p));
            surface.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
    }
    deck
}

#[expect(clippy::disallowed_methods, reason = "published data")]
fn answer(deck: &ImportedDeck, case: &Path) -> Diagnosis {
    let sources = ["kla", "rks"].map(|name| {
        let trials = sim::laxity::read(&std::fs::read(case.join(format!("{name}.csv"))).unwrap()).unwrap().trials;
        // every other trial: the law is of any set
        Source::new(name, trials.into_iter().step_by(2).collect())
    });
    let few = DiagnosisOptions { nulls: 50, most_effects: 1, shortlist: 2, folds: 2, ..DiagnosisOptions::default() };
    let (options, calibrate) = (few, CalibrateOptions::default());
    let model = diagnosis::problem::rim::prepared(&deck.spec, &deck.meshes, &calibrate.search).unwrap();
    let calibration = Calibration { options: &calibrate, mode: None };
    diagnose(&model, &deck.spec, &sources, &Catalogue::shipped(), &options, calibration).unwrap().diagnosis
}

#[needs_shared]
fn a_mirrored_knee_gets_the_same_answer() {
    let Some(folder) = shared("mirrored", "published/S192803/deck") else { return };
    let Some(case) = shared("mirrored", "blind/case_009") else { return };
    #[expect(clippy::disallowed_methods, reason = "published data")]
    let mut read = |name: &str| std::fs::read(folder.join(name)).map_err(|e| e.to_string());
    let deck = decks::import("S192803_MAIN_LAXITY_Anterior_0deg_0.inp", &mut read).unwrap();
    let [left, right] = [answer(&deck, &case), answer(&mirrored(deck), &case)];
    assert_eq!(left.verdict, right.verdict);
    // the fields of the contact are sampled on other points of the same surfaces: what is left differs by little
    let [a, b] = [&left, &right].map(|d| d.best_log_bayes_factor.unwrap());
    assert!(a > 3.0 && (a - b).abs() < 1.0, "{a} {b}");
    let [one, other] = [&left, &right].map(|d| d.best.clone());
    assert!(!one.is_empty() && one.len() == other.len());
    for (x, y) in one.iter().zip(&other) {
        assert_eq!((&x.effect, &x.scope, &x.variant), (&y.effect, &y.scope, &y.variant));
        for (key, v) in &x.parameters {
            let w = &y.parameters[key];
            assert!((v.value - w.value).abs() < 0.2 * v.sd, "{key}: {v:?} {w:?}");
        }
    }
}
