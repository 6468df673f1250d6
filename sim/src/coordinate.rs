//! The six clinical coordinates of the joint [grood1983], and values that belong to them.
//!
//! [`Six`] holds all six. [`Free`] holds the five that are free when flexion is prescribed: readings [deg, mm]. [`Load`] holds the loads on
//! those five [N m, N]. All three are indexed by [`Coordinate`] alone.

use nalgebra::{Matrix5, Matrix6, Vector5, Vector6};
use serde::{Deserialize, Serialize};
use std::ops::{Deref, DerefMut, Index, IndexMut};

/// A clinical coordinate of the joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Coordinate {
    /// Flexion-extension.
    Fe,
    /// Varus-valgus.
    Vv,
    /// Internal-external rotation.
    Ie,
    /// Medial-lateral translation.
    Ml,
    /// Anterior-posterior translation.
    Ap,
    /// Superior-inferior translation.
    Si,
}

/// Flexion-extension.
pub const FE: Coordinate = Coordinate::Fe;
/// Varus-valgus.
pub const VV: Coordinate = Coordinate::Vv;
/// Internal-external rotation.
pub const IE: Coordinate = Coordinate::Ie;
/// Medial-lateral translation.
pub const ML: Coordinate = Coordinate::Ml;
/// Anterior-posterior translation.
pub const AP: Coordinate = Coordinate::Ap;
/// Superior-inferior translation.
pub const SI: Coordinate = Coordinate::Si;
/// All coordinates, in order.
pub const ALL: [Coordinate; 6] = [FE, VV, IE, ML, AP, SI];
/// The coordinates that are free when flexion is prescribed, in order.
pub const FREE: [Coordinate; 5] = [VV, IE, ML, AP, SI];

/// Lever by which angles compare with displacements and moments with forces [mm]: about a condyle's radius.
pub(crate) const LEVER_MM: f64 = 30.0;

/// Newton metres in newton millimetres.
const NMM_PER_NM: f64 = 1e3;

impl Coordinate {
    /// Place among all six: the row of [`Six`] and of 6 x 6 matrices.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Place among the free five: the row of vectors and matrices of free coordinates.
    ///
    /// # Panics
    /// For flexion.
    pub const fn free_index(self) -> usize {
        self as usize - 1
    }

    /// Whether it is a rotation.
    pub const fn turns(self) -> bool {
        matches!(self, FE | VV | IE)
    }

    /// Its name in files: `fe`, `vv`, `ie`, `ml`, `ap`, `si`.
    pub const fn name(self) -> &'static str {
        ["fe", "vv", "ie", "ml", "ap", "si"][self as usize]
    }

    /// Unit of its values in files and on screen.
    pub const fn unit(self) -> &'static str {
        if self.turns() { "deg" } else { "mm" }
    }

    /// Unit of its load on screen.
    pub const fn load_unit(self) -> &'static str {
        if self.turns() { "N m" } else { "N" }
    }

    /// Column of its values in files: `vv_deg`, `ap_mm`.
    pub fn column(self) -> String {
        format!("{}_{}", self.name(), self.unit())
    }

    /// Unit of its load in names of files' columns.
    pub const fn load_suffix(self) -> &'static str {
        if self.turns() { "nm" } else { "n" }
    }

    /// Column of its load in files: `load_vv_nm`, `load_ap_n`.
    pub fn load_column(self) -> String {
        format!("load_{}_{}", self.name(), self.load_suffix())
    }

    /// The coordinate of a name in files.
    pub fn named(name: &str) -> Option<Coordinate> {
        ALL.into_iter().find(|c| c.name() == name)
    }

    /// A value of files [deg, mm] in the solver's units [rad, mm].
    pub fn to_solver(self, value: f64) -> f64 {
        if self.turns() { value.to_radians() } else { value }
    }

    /// A value of the solver [rad, mm] in the units of files [deg, mm].
    pub fn to_file(self, value: f64) -> f64 {
        if self.turns() { value.to_degrees() } else { value }
    }

    /// A load of files [N m, N] as a generalised force [N mm, N].
    pub fn to_force(self, load: f64) -> f64 {
        if self.turns() { load * NMM_PER_NM } else { load }
    }
}

impl std::fmt::Display for Coordinate {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// Six numbers, one a coordinate, indexed by [`Coordinate`].
pub type Six = Vector6<f64>;

impl Index<Coordinate> for Six {
    type Output = f64;
    fn index(&self, c: Coordinate) -> &f64 {
        &self[c.index()]
    }
}

impl IndexMut<Coordinate> for Six {
    fn index_mut(&mut self, c: Coordinate) -> &mut f64 {
        &mut self[c.index()]
    }
}

/// The rows and columns of the free coordinates.
pub fn free_block(m: &Matrix6<f64>) -> Matrix5<f64> {
    m.fixed_view::<5, 5>(1, 1).into_owned()
}

/// The rows of the free coordinates.
pub fn free_part(v: &Six) -> Vector5<f64> {
    v.fixed_rows::<5>(1).into_owned()
}

/// A value for each free coordinate. Numbers are readings: VV, IE [deg], ML, AP, SI [mm]. Files hold a list of five.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Free<T>(pub [T; 5]);

impl<T> Free<T> {
    /// The values of a function.
    pub fn from_fn(mut of: impl FnMut(Coordinate) -> T) -> Free<T> {
        Free(FREE.map(&mut of))
    }

    /// The values, in order.
    pub fn iter(&self) -> std::slice::Iter<'_, T> {
        self.0.iter()
    }

    /// The values, in order, to be changed.
    pub fn iter_mut(&mut self) -> std::slice::IterMut<'_, T> {
        self.0.iter_mut()
    }

    /// Each coordinate with its value.
    pub fn each(&self) -> impl Iterator<Item = (Coordinate, &T)> {
        FREE.into_iter().zip(&self.0)
    }

    /// The function's value of each value.
    pub fn map<U>(self, of: impl FnMut(T) -> U) -> Free<U> {
        Free(self.0.map(of))
    }
}

impl<T: Copy> Free<T> {
    /// The same value for each.
    pub const fn all(value: T) -> Free<T> {
        Free([value; 5])
    }
}

impl<T> Index<Coordinate> for Free<T> {
    type Output = T;
    fn index(&self, c: Coordinate) -> &T {
        &self.0[c.free_index()]
    }
}

impl<T> IndexMut<Coordinate> for Free<T> {
    fn index_mut(&mut self, c: Coordinate) -> &mut T {
        &mut self.0[c.free_index()]
    }
}

impl<T> IntoIterator for Free<T> {
    type Item = T;
    type IntoIter = std::array::IntoIter<T, 5>;
    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

impl<'a, T> IntoIterator for &'a Free<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;
    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

/// Loads on the tibia, conjugate to the free coordinates: VV, IE [N m], ML, AP, SI [N]. Files hold a list of five.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Load(pub Free<f64>);

impl Load {
    /// VV, IE [N m], ML, AP, SI [N].
    pub const fn new(vv: f64, ie: f64, ml: f64, ap: f64, si: f64) -> Load {
        Load(Free([vv, ie, ml, ap, si]))
    }

    /// Compression alone [N].
    pub const fn compression(newtons: f64) -> Load {
        Load::new(0.0, 0.0, 0.0, 0.0, newtons)
    }

    /// The values of a function.
    pub fn from_fn(of: impl FnMut(Coordinate) -> f64) -> Load {
        Load(Free::from_fn(of))
    }

    /// As generalised forces [N mm, N]; none on flexion.
    pub fn generalised(&self) -> Six {
        let mut out = Six::zeros();
        FREE.into_iter().for_each(|c| out[c] = c.to_force(self[c]));
        out
    }
}

impl Deref for Load {
    type Target = Free<f64>;
    fn deref(&self) -> &Free<f64> {
        &self.0
    }
}

impl DerefMut for Load {
    fn deref_mut(&mut self) -> &mut Free<f64> {
        &mut self.0
    }
}

impl<'a> IntoIterator for &'a Load {
    type Item = &'a f64;
    type IntoIter = std::slice::Iter<'a, f64>;
    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_index_means_its_coordinate() {
        let six = Six::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0);
        let free = Free::from_fn(|c| six[c]);
        for (k, c) in ALL.into_iter().enumerate() {
            assert_eq!((c.index(), six[c]), (k, k as f64 + 1.0));
            assert_eq!(Coordinate::named(c.name()), Some(c));
        }
        for (c, x) in free.each() {
            assert_eq!((*x, free_part(&six)[c.free_index()]), (six[c], six[c]));
        }
        let load = Load::new(1.0, 2.0, 3.0, 4.0, 5.0);
        assert_eq!(load.generalised(), Six::new(0.0, 1e3, 2e3, 3.0, 4.0, 5.0));
        assert_eq!(
            (AP.column(), VV.column(), AP.load_column(), IE.load_column()),
            ("ap_mm".into(), "vv_deg".into(), "load_ap_n".into(), "load_ie_nm".into())
        );
    }
}
