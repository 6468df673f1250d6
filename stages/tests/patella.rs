//! A patella laid on phantoms: the knee's own where a label map shows one, else one of mean shape.
#![expect(clippy::unwrap_used, reason = "a test may fail by panicking")]
#![expect(clippy::print_stdout, reason = "figures for the reader of the log")]

use crate::common::phantoms::made;
use meshes::surface::TriMesh;
use stages::StageError;
use stages::bones::{Bones, BonesOptions, bones};
use stages::cartilage::{Cartilage, CartilageOptions, cartilage};
use stages::frames::{Frames, FramesOptions, frames};
use stages::ingest::ingest;
use stages::patellofemoral::{PatellaChoice, PatellaOptions, Patellofemoral, patellofemoral};
use stages::phantom::MRI_PHANTOM;
use stages::register::{RegisterOptions, Registration, register};
use stages::specimen::{IngestOptions, RawSpecimen, Specimen};

struct Knee {
    specimen: Specimen,
    bones: Bones,
    cartilage: Cartilage,
    frames: Frames,
    trochlea: TriMesh,
}

fn knee(id: &str) -> Knee {
    let mut raw = RawSpecimen::default();
    for (name, bytes) in made(id).files.clone() {
        if name == "specimen.toml" {
            raw.toml = String::from_utf8(bytes).unwrap();
        } else {
            raw.files.insert(name, bytes);
        }
    }
    let specimen = ingest(&raw, &IngestOptions::default()).unwrap();
    let registration = if id == MRI_PHANTOM {
        Registration::left_out()
    } else {
        register(&specimen, &RegisterOptions::default()).unwrap()
    };
    let bones = bones(&specimen, &BonesOptions::default()).unwrap();
    let cartilage = cartilage(&specimen, &registration, &bones, &CartilageOptions::default()).unwrap();
    let frames = frames(&specimen, &bones, &FramesOptions::default()).unwrap();
    let solid = &cartilage.solids.femur;
    let trochlea = solid.solid.submesh(|t| solid.articular[t]).0;
    Knee { specimen, bones, cartilage, frames, trochlea }
}

fn laid(knee: &Knee, choice: PatellaChoice) -> Result<Option<Patellofemoral>, StageError> {
    patellofemoral(
        choice,
        (&knee.specimen, &knee.frames, &knee.bones),
        (&knee.cartilage, &knee.trochlea),
        (&[0.0, 0.1], &[0.0, 0.6]),
        &PatellaOptions::default(),
    )
}

#[test]
fn a_patella_lies_before_its_trochlea_on_a_tendon_of_its_length() {
    let knee = knee(MRI_PHANTOM);
    assert!(laid(&knee, PatellaChoice::Off).unwrap().is_none());
    for choice in [PatellaChoice::On, PatellaChoice::Generic] {
        let patella = laid(&knee, choice).unwrap().unwrap();
        let m = &patella.metrics;
        println!("{choice:?}: {m:?} {:?}", patella.warnings);
        assert!((-1.5..6.0).contains(&m.gap_min_mm), "{choice:?}: gap {}", m.gap_min_mm);
        assert!((35.0..55.0).contains(&m.width_mm) && (15.0..35.0).contains(&m.groove_radius_mm), "{m:?}");
        assert!(m.articular_area_mm2 > 400.0 && !patella.ground.triangles.is_empty());
        // it looks back at the femur
        let face = &patella.face;
        let back: f64 = (0..face.triangles.len()).map(|t| -face.area_vector(t).dot(&patella.spec.frame.anterior)).sum();
        assert!(back > 0.7 * face.area());
        // the quadriceps' lines are the middle of a tendon that lies on the groove, and is less than 12 mm thick
        let above = patella.spec.quadriceps.wrap_radius_mm - m.groove_radius_mm;
        assert!((2.0..6.0).contains(&above), "{above}");
        let shares: f64 = patella.spec.quadriceps.heads.iter().map(|h| h.share).sum();
        assert!((shares - 1.0).abs() < 1e-9);
    }
    let generic = laid(&knee, PatellaChoice::Generic).unwrap().unwrap();
    assert!((generic.metrics.insall_salvati - 1.0).abs() < 0.1, "{}", generic.metrics.insall_salvati);
    assert!(generic.seen.unwrap().volume() > 8000.0);
}

#[test]
fn a_patella_that_nobody_saw_is_not_made_up() {
    let knee = knee("right-phantom");
    let error = laid(&knee, PatellaChoice::On).unwrap_err().to_string();
    assert!(error.contains("neither CT nor MRI shows a patella") && error.contains("generic"), "{error}");
    assert!(laid(&knee, PatellaChoice::Generic).unwrap().is_some());
}
