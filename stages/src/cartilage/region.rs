//! Where cartilage is: patches of bone with clean rims.

use super::CartilageOptions;
use super::field::Domain;
use super::parting::part;
use super::vertices::{bodies, mean};
use meshes::Vector;
use meshes::measure::percentile;
use meshes::surface::TriMesh;
use std::collections::BTreeMap;

/// A patch of bone covered by cartilage.
pub(super) struct Patch {
    /// The covered bone, with a smooth rim.
    pub(super) bone: TriMesh,
    /// Unit normals of the bone at its vertices.
    pub(super) normals: Vec<Vector>,
    /// Height at which cartilage begins [mm].
    pub(super) inner: Vec<f64>,
    /// Height at which it ends [mm].
    pub(super) outer: Vec<f64>,
}

/// The patches thicker than `least`, largest first, and whether the largest had to be parted; with `facing`, only on bone whose normal
/// lies within 84 degrees of it, and the largest parted in two where two have run together.
pub(super) fn patches(
    domain: &Domain,
    least: f64,
    facing: Option<Vector>,
    options: &CartilageOptions,
) -> (Vec<Patch>, bool) {
    let count = domain.bone.vertices.len();
    let turned_away = |v: usize| facing.is_some_and(|f| domain.normals[v].dot(&f) < 0.1);
    let mut level: Vec<f64> = (0..count)
        .map(|v| if turned_away(v) { -least } else { (domain.thickness(v) - least).clamp(-least, least) })
        .collect();
    grow(domain, &mut level, least, facing, options);
    for _ in 0..options.rim_smoothing_rounds {
        level = (0..count).map(|v| 0.5 * level[v] + 0.5 * mean(&level, &domain.neighbours[v], level[v])).collect();
    }
    let area = domain.bone.vertex_areas();
    let tiny = 0.02 * least;
    level.iter_mut().for_each(|x| *x = if x.abs() < tiny { tiny.copysign(*x) } else { *x });
    // bare islands within cartilage are covered
    for island in bodies(&domain.neighbours, |v| level[v as usize] < 0.0).into_iter().skip(1) {
        if island.iter().map(|&v| area[v as usize]).sum::<f64>() < options.island_area_mm2 {
            island.iter().for_each(|&v| level[v as usize] = least);
        }
    }
    let mut found = covers(domain, &level, &area, options);
    let parted = facing.is_some() && part(domain, &mut level, &found, least, options);
    if parted {
        found = covers(domain, &level, &area, options);
    }
    (found.into_iter().map(|(_, body)| cut(domain, &level, &body, least)).collect(), parted)
}

/// Bodies of covered vertices with their areas, largest first, that are large and thick enough to be cartilage.
fn covers(domain: &Domain, level: &[f64], area: &[f64], options: &CartilageOptions) -> Vec<(f64, Vec<u32>)> {
    let mut found: Vec<(f64, Vec<u32>)> = bodies(&domain.neighbours, |v| level[v as usize] > 0.0)
        .into_iter()
        .map(|body| (body.iter().map(|&v| area[v as usize]).sum::<f64>(), body))
        .filter(|(size, body)| {
            let mut thickness: Vec<f64> = body.iter().map(|&v| domain.thickness(v as usize)).collect();
            *size >= options.least_area_mm2 && percentile(&mut thickness, 0.75) >= options.seed_thickness_mm
        })
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    found
}

/// Lowers the threshold, by less the farther out, to that of the rim near what is cartilage without doubt: a rim thins out, a lone sheet of the same
/// thickness may be an error of CT.
fn grow(domain: &Domain, level: &mut [f64], least: f64, facing: Option<Vector>, options: &CartilageOptions) {
    let rim = options.rim_thickness_mm.max(options.least_thickness_sd * domain.bare_sd).min(least);
    let rings = options.rim_rings + 1;
    let mut ring: Vec<usize> = level.iter().map(|l| if *l > 0.0 { 0 } else { rings }).collect();
    for k in 1..rings {
        for v in 0..ring.len() {
            if ring[v] == rings && domain.neighbours[v].iter().any(|&w| ring[w as usize] == k - 1) {
                ring[v] = k;
            }
        }
    }
    for v in (0..level.len()).filter(|&v| !facing.is_some_and(|f| domain.normals[v].dot(&f) < 0.1)) {
        let above = |height: f64| (domain.thickness(v) - height).clamp(-least, least);
        if ring[v] < rings {
            level[v] = above(rim + (least - rim) * ring[v] as f64 / rings as f64);
        }
        // where the scan itself steps down, half the step is the place to cut
        if domain.thin_rim[v] {
            level[v] = level[v].max(above(0.5 * rim));
        }
    }
}

/// The part of the bone on which `level` is positive about `body`, cut along its zero line.
fn cut(domain: &Domain, level: &[f64], body: &[u32], least: f64) -> Patch {
    let mut member = vec![false; level.len()];
    body.iter().for_each(|&v| member[v as usize] = true);
    let mut patch = Patch { bone: TriMesh::default(), normals: Vec::new(), inner: Vec::new(), outer: Vec::new() };
    let mut index: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    for &t in &domain.bone.triangles {
        let inside = t.map(|v| member[v as usize]);
        let count = inside.iter().filter(|x| **x).count();
        if count == 0 {
            continue;
        }
        let odd = if count == 3 { 0 } else { (0..3).find(|&k| inside[k] == (count == 1)).unwrap_or(0) };
        let [a, b, c] = [t[odd], t[(odd + 1) % 3], t[(odd + 2) % 3]];
        let mut put = |p: u32, q: u32| {
            *index.entry((p, q)).or_insert_with(|| {
                add(&mut patch, domain, level, (p as usize, q as usize), least);
                patch.bone.vertices.len() as u32 - 1
            })
        };
        // a rim vertex is named (member, other), a whole one (v, v)
        let faces = match count {
            3 => vec![[put(a, a), put(b, b), put(c, c)]],
            1 => vec![[put(a, a), put(a, b), put(a, c)]],
            _ => {
                let (ab, ac, b, c) = (put(b, a), put(c, a), put(b, b), put(c, c));
                vec![[ab, b, c], [ab, c, ac]]
            }
        };
        patch.bone.triangles.extend(faces);
    }
    patch
}

fn add(patch: &mut Patch, domain: &Domain, level: &[f64], (p, q): (usize, usize), least: f64) {
    let s = if p == q { 0.0 } else { (level[p] / (level[p] - level[q])).clamp(0.15, 0.85) };
    let (a, b) = (domain.bone.vertices[p], domain.bone.vertices[q]);
    patch.bone.vertices.push(a + (b - a) * s);
    let n = domain.normals[p] * (1.0 - s) + domain.normals[q] * s;
    patch.normals.push(n.try_normalize(1e-9).unwrap_or(domain.normals[p]));
    patch.inner.push(domain.inner[p]);
    patch.outer.push(domain.outer[p].max(domain.inner[p] + 0.4 * least));
}
