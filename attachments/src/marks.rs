//! Outlines drawn on a scanned bone: found by colour, closed, measured.
//!
//! Ink is dark against the colour of the bone around it ([`ink`]); an outline is ink around a patch of bone, closed or nearly so
//! ([`outline`]); its region reaches to the middle of the line ([`region`]) and is carried onto the CT bone ([`project`]).

pub mod ink;
pub mod outline;
pub mod project;
pub mod region;

use meshes::surface::ColouredMesh;
use meshes::topology::vertex_neighbours;
use region::Region;
use serde::{Deserialize, Serialize};

/// How outlines are found on a scan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MarkOptions {
    /// Radius over which the bone's own colour is taken [mm]; wider than a line, narrower than the bone. Ours.
    pub bone_colour_radius_mm: f64,
    /// Smallest outlined region [mm2]; below it are letters, dots and screw slots. Ours: half the smallest footprint of the knee's
    /// ligaments (LCL 48 mm2, [laprade2003]) is 24, less the error of a thick line on a small region.
    pub area_min_mm2: f64,
    /// Largest outlined region [mm2]: twice the largest footprint (sMCL, tibia). Ours.
    pub area_max_mm2: f64,
    /// Widest line [mm]. Ours.
    pub line_width_max_mm: f64,
    /// Largest share of an outline, by angle seen from its middle, that may be missing [-]. Ours.
    pub gap_fraction_max: f64,
    /// Fragments of ink this close may belong to one broken outline [mm]. Ours.
    pub fragment_distance_mm: f64,
}

impl Default for MarkOptions {
    fn default() -> Self {
        MarkOptions {
            bone_colour_radius_mm: 12.0,
            area_min_mm2: 12.0,
            area_max_mm2: 900.0,
            line_width_max_mm: 6.0,
            gap_fraction_max: 0.35,
            fragment_distance_mm: 5.0,
        }
    }
}

/// The outlined regions of a scan, scan frame, in the order of their lowest vertex; none where the scan has no colours.
pub fn find_outlines(scan: &ColouredMesh, options: &MarkOptions) -> Vec<Region> {
    if scan.colours.len() != scan.mesh.vertices.len() || scan.colours.is_empty() {
        return Vec::new();
    }
    let neighbours = vertex_neighbours(&scan.mesh);
    let ink = ink::ink(scan, options.bone_colour_radius_mm);
    let surface = outline::Inked { mesh: &scan.mesh, neighbours: &neighbours, ink: &ink };
    let normals = scan.mesh.vertex_normals();
    let mut regions: Vec<Region> = Vec::new();
    for interior in outline::closed(&surface, options).into_iter().chain(outline::broken(&surface, options)) {
        let Some(region) = region::measure(&surface, &normals, &interior, options) else { continue };
        if regions.iter().all(|r| !r.overlaps(&region)) {
            regions.push(region);
        }
    }
    regions.sort_by_key(|r| r.vertices.first().copied());
    regions
}
