//! The published deck as a question.
use crate::common::shared;
use calibration::options::CalibrateOptions;
use decks::ImportedDeck;
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::problem::Problem;
use diagnosis::problem::trial::Source;

/// A trial of the published deck: name, test, flexion [deg], load (varus-valgus, internal-external [N m], medial-lateral, anterior-posterior [N]) beside a
/// compression of 50 N, and what was measured (VV, IE [deg], ML, AP, SI [mm]).
pub(crate) type Asked<'a> = (&'a str, &'a str, f64, [f64; 4], [f64; 5]);

/// The question of the published deck under these trials; `None` where the deck is not there.
pub(crate) fn deck(test: &str, trials: &[Asked]) -> Option<Problem> {
    question(test, &[("rks", trials)])
}

/// The question of the published deck under the trials of several data sets.
#[expect(clippy::unwrap_used, reason = "tests")]
pub(crate) fn question(test: &str, sources: &[(&str, &[Asked])]) -> Option<Problem> {
    let deck = published(test)?;
    let model = sim::compile(&deck.spec, &deck.meshes).unwrap();
    let sources: Vec<Source> = sources.iter().map(|(name, trials)| source(name, trials)).collect();
    Some(Problem::new(&model, &deck.spec, &sources, &Catalogue::shipped(), &CalibrateOptions::default()).unwrap())
}

/// The published deck; `None` where it is not there.
#[expect(clippy::unwrap_used, reason = "tests")]
pub(crate) fn published(test: &str) -> Option<ImportedDeck> {
    let folder = shared(test, "published/S192803/deck")?;
    #[expect(clippy::disallowed_methods, reason = "published data")]
    let mut read = |name: &str| std::fs::read(folder.join(name)).map_err(|e| e.to_string());
    Some(decks::import("S192803_MAIN_LAXITY_Anterior_0deg_0.inp", &mut read).unwrap())
}

/// A data set, as a file of these trials is read.
#[expect(clippy::unwrap_used, reason = "tests")]
pub(crate) fn source(name: &str, trials: &[Asked]) -> Source {
    let mut text = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,\
                    fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm\n"
        .to_owned();
    for (k, (trial, test, flexion, [lvv, lie, lml, lap], [vv, ie, ml, ap, si])) in trials.iter().enumerate() {
        text +=
            &format!("{trial}_{k},{test},{flexion},{lvv},{lie},{lml},{lap},50,{flexion},{vv},{ie},{ml},{ap},{si}\n");
    }
    Source::new(name, sim::laxity::read(text.as_bytes()).unwrap().trials)
}
