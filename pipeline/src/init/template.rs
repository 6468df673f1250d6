//! The specimen.toml that `init` writes, every key with its meaning, and the laxity file to fill in.

use super::Filled;
use std::fmt::Write;

/// A laxity file with two rows, one of them a largest load, to write over.
pub(super) const LAXITY: &str = "\
trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm,sd_vv_deg,sd_ie_deg,sd_ml_mm,sd_ap_mm,sd_si_mm
neutral_30,neutral,30,0,0,0,0,20,30.0,0.5,1.2,4.0,-1.0,-21.0,0.5,0.5,0.4,0.4,0.4
anterior_30,anterior,30,0,0,0,133,20,30.2,-1.0,-0.8,3.5,4.6,-21.3,0.5,0.5,0.4,0.4,0.4
";

/// specimen.toml with what is known filled in and the rest commented out.
pub(super) fn specimen_toml(filled: &Filled) -> String {
    let mut out = String::from(
        "# One knee. Lengths in mm, angles in degrees, forces in N, moments in N m.\n\
         # A key after `#` is optional: remove the `#` to use it.\n\
         # When it is filled in: build-model check . (in this folder)\n\n[specimen]\n",
    );
    let _ = writeln!(out, "id = {:?}               # a name for this knee", filled.id);
    match filled.side {
        Some(side) => {
            let _ = writeln!(out, "side = \"{side}\"           # left or right; {}", filled.side_by);
        }
        None => out += "side = \"left\"           # left or right: nothing tells which, correct it\n",
    }
    out += "# sex = \"female\"         # male or female\n\
            # age_years = 60\n# height_cm = 170.0\n# mass_kg = 70.0\n\
            provenance = \"own\"      # own, published or synthetic\n# note = \"where the data come from\"\n";
    section(
        &mut out,
        filled,
        "ct",
        "\n# Closed surfaces of the bones from CT, both in one frame. STL, PLY or OBJ.\n",
        &[
            ("femur", "ct/femur.stl", "the femur", true),
            ("tibfib", "ct/tibfib.stl", "the tibia with the fibula", true),
            ("patella", "ct/patella.stl", "carried along, not simulated", false),
            ("volume", "ct/knee.nii.gz", "in place of the surfaces: the CT itself, NIfTI or a folder of DICOM", false),
            ("labels", "ct/labels.nii.gz", "a label map of the volume, made by hand", false),
        ],
    );
    section(
        &mut out,
        filled,
        "scans",
        "\n# Surface scans of the dissected bones with their cartilage on. Each in its own frame.\n\
         # Colours show the outlined ligament sites. A bone scanned in pieces: femur = [\"a.ply\", \"b.ply\"]\n",
        &[
            ("femur", "scans/femur.ply", "the femur", true),
            ("tibfib", "scans/tibfib.ply", "the tibia with the fibula", true),
            ("patella", "scans/patella.ply", "the patella", false),
            ("capsule", "scans/capsule.ply", "the knee with its capsule on: checks the registration", false),
        ],
    );
    segmentation(&mut out, filled);
    let cartilage = |key: &str| filled.paths.get(&("cartilage".to_owned(), key.to_owned()));
    if CARTILAGES.iter().any(|key| cartilage(key).is_some()) {
        out += "\n# Surfaces of cartilage from MRI in place of the scans. frame: ct, or mri with the bones that MRI shows (docs/specimen.md).\n[cartilage]\n";
        for key in CARTILAGES {
            let path = cartilage(key).map_or_else(|| format!("mri/{key}.stl"), Clone::clone);
            let _ = writeln!(out, "{key} = \"{path}\"");
        }
        out += "frame = \"ct\"\n";
    }
    section(
        &mut out,
        filled,
        "points",
        "\n# Tables of points. The column frame says ct, scan_femur or scan_tibfib.\n",
        &[
            ("landmarks", "landmarks.csv", "name,frame,x_mm,y_mm,z_mm", false),
            ("marks", "marks.csv", "ligament,frame,x_mm,y_mm,z_mm: a rough point of each outlined site", false),
            ("attachments", "attachments.csv", "fibres given by hand, CT frame", false),
        ],
    );
    named(
        &mut out,
        filled,
        "laxity",
        LAXITY_HEAD,
        "# kla = \"laxity/example.csv\"   # a name of yours, and the file\n",
    );
    out += LAXITY_FORMAT;
    named(&mut out, filled, "passive", PASSIVE_HEAD, "# rks = \"passive/rks.csv\"\n");
    out + TAIL
}

/// A table of known keys: those filled in, then the others commented out.
fn section(out: &mut String, filled: &Filled, table: &str, words: &str, keys: &[(&str, &str, &str, bool)]) {
    let path = |key: &str| filled.paths.get(&(table.to_owned(), key.to_owned()));
    // a label map shows the bones and stands in place of the scans, as cartilages of MRI do
    let cartilages = filled.paths.keys().any(|(t, _)| t == "cartilage");
    let instead = !filled.labels.is_empty() || (table == "scans" && cartilages);
    let volume = table == "ct" && path("volume").is_some() || instead;
    let any = keys.iter().any(|k| (k.3 && !instead) || path(k.0).is_some());
    let _ = writeln!(out, "{words}{}[{table}]", if any { "" } else { "# " });
    for (key, usual, meaning, needed) in keys {
        let (lead, path) = match path(key) {
            Some(path) => ("", path.as_str()),
            None if *needed && !volume => ("", *usual),
            None => ("# ", *usual),
        };
        let _ = writeln!(out, "{lead}{key} = \"{path}\"   # {meaning}");
    }
}

/// The table of a label map.
fn segmentation(out: &mut String, filled: &Filled) {
    *out += "\n# A living knee: a label map of MRI in place of the scans, and of CT where that is not given. NIfTI, NRRD or MetaImage.\n";
    let lead = if filled.labels.is_empty() { "# " } else { "" };
    let path = filled.paths.get(&("segmentation".to_owned(), "labels".to_owned()));
    let _ = writeln!(out, "{lead}[segmentation]");
    let _ = writeln!(out, "{lead}labels = \"{}\"", path.map_or("mri/labels.nrrd", String::as_str));
    for (k, key) in LABELS.into_iter().enumerate() {
        let _ = match filled.labels.get(key) {
            Some(label) => writeln!(out, "{key} = {label}"),
            None => writeln!(out, "# {key} = {}   # a label's number, or a segment's name", k + 1),
        };
    }
}

/// Keys of `[cartilage]`, all of them needed.
const CARTILAGES: [&str; 3] = ["femur", "tibia_medial", "tibia_lateral"];

/// Keys of `[segmentation]`; the first five are needed.
const LABELS: [&str; 10] = [
    "femur",
    "tibia",
    "femoral_cartilage",
    "tibial_cartilage_medial",
    "tibial_cartilage_lateral",
    "fibula",
    "patella",
    "patellar_cartilage",
    "meniscus_medial",
    "meniscus_lateral",
];

/// A table whose keys are names of the owner's.
fn named(out: &mut String, filled: &Filled, table: &str, words: &str, example: &str) {
    let mine: Vec<_> = filled.paths.iter().filter(|((t, _), _)| t == table).collect();
    let _ = writeln!(out, "{words}{}[{table}]", if mine.is_empty() { "# " } else { "" });
    for ((_, key), path) in &mine {
        let plain = key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
        let key = if plain { (*key).clone() } else { format!("{key:?}") };
        let _ = writeln!(out, "{key} = \"{path}\"");
    }
    if mine.is_empty() {
        *out += example;
    }
}

const LAXITY_HEAD: &str = "
# Measured laxity: one file a source, a row a trial. laxity/example.csv shows the columns.
# Signs: flexion, valgus, external, lateral, anterior, superior and compression are positive.
";

const LAXITY_FORMAT: &str = "
# A laxity file in another shape. Semicolons, decimal commas and a row of units are recognised.
# [laxity_format.kla]
# nominal_flexions_deg = [0, 30, 60, 90]   # where the file has no nominal flexion
# loads_on = \"tibia\"                       # or femur: the loads' signs turn round
# branch_from_load = true                  # loading and unloading, by the order of the rows
# constants = { load_si_n = 20 }           # columns that are the same in every row
# tests = { \"ant drawer\" = \"anterior\" }    # your words for tests
# [laxity_format.kla.columns]              # standard column = yours
# load_ap_n = \"Force AP [kN]\"              # the unit is read from brackets or the row of units
# vv_deg = { name = \"Varus\", unit = \"rad\", positive = \"varus\" }
# ml_mm = { name = \"X\", positive = \"right\" }   # right or left where your axes do not turn with the side
";

const PASSIVE_HEAD: &str = "
# Measured passive flexion: fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm
";

const TAIL: &str = "
# Where a ligament's parameters start, a table a bundle.
# [ligaments.ACL_AM]
# reference_strain = 1.07
# stiffness_n_per_mm = 68.5

# Options of a stage. build-model options lists them all.
# [options.hexmesh]
# edge_length_mm = 0.9
";
