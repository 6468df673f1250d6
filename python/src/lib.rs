//! `genu._genu`: the commands of build-model, called from Python. Everything that has a shape is in `python/genu/`.

use genu::error::BuildError;
use genu::progress::{Event, watched};
use genu::store::given::Given;
use genu::which_model::{WhichModel, chosen};
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError};
use pyo3::prelude::*;
use sim::interrupt::{Interrupted, Request};
use std::any::Any;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

/// How often Python may look for Ctrl-C while the work goes on.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// Stack of the thread that works [bytes]: that of a main thread, for which the program is made.
const STACK: usize = 8 << 20;

/// What the working thread tells the one that waits.
enum Told<T> {
    Event(Event),
    Done(thread::Result<Result<T, BuildError>>),
}

/// Number of threads and watcher, as Python gives them.
type How = (Option<usize>, Option<Py<PyAny>>);

/// How a call is made: threads, who is told how far it is, files in memory, who makes exceptions.
struct Calling {
    /// `failure(kind, stage, message, (file, row, column), table, {key, value, advice})` makes the exception that is raised.
    failure: Py<PyAny>,
    /// Number of threads; all where None.
    jobs: Option<usize>,
    /// `watcher(stage, share, message)`, called on the thread of the call.
    watcher: Option<Py<PyAny>>,
    /// Files by the paths at which the work finds them.
    files: BTreeMap<PathBuf, Vec<u8>>,
}

/// Works without Python's lock, on threads that are of this call alone and end with it: a process that is forked afterwards lacks none, and a
/// request to stop is heard by this call and no other.
fn called<T: Send + 'static>(
    py: Python<'_>,
    calling: Calling,
    work: impl FnOnce() -> Result<T, BuildError> + Send + 'static,
) -> PyResult<T> {
    let (sender, mut receiver) = channel();
    let stop = Request::default();
    let (heard, jobs, files) = (stop.clone(), calling.jobs, Given::new(calling.files));
    let begun = thread::Builder::new().name("genu".into()).spawn(move || {
        let result = catch_unwind(AssertUnwindSafe(|| at_work(work, jobs, &sender, &heard, &files)));
        let _ = sender.send(Told::Done(result));
    });
    let begun = begun.map_err(|e| PyRuntimeError::new_err(format!("no thread could be started: {e}")))?;
    let (done, raised) = wait(py, &mut receiver, calling.watcher.as_ref(), &stop);
    // until its threads are gone, a fork would lack them
    let _ = py.detach(move || begun.join());
    if let Some(raised) = raised {
        return Err(raised);
    }
    match done {
        Some(Ok(Ok(value))) => Ok(value),
        Some(Ok(Err(error))) => Err(exception(py, &calling.failure, &error)),
        Some(Err(payload)) if payload.is::<Interrupted>() => Err(PyKeyboardInterrupt::new_err("stopped")),
        Some(Err(payload)) => {
            Err(PyRuntimeError::new_err(format!("internal error, please report it: {}", words_of(&*payload))))
        }
        None => Err(PyRuntimeError::new_err("internal error, please report it: the work ended without a word")),
    }
}

/// Waits for the end of the work; passes events on, and Python's signals as a request to stop.
fn wait<T: Send>(
    py: Python<'_>,
    receiver: &mut Receiver<Told<T>>,
    watcher: Option<&Py<PyAny>>,
    stop: &Request,
) -> (Option<thread::Result<Result<T, BuildError>>>, Option<PyErr>) {
    let mut raised: Option<PyErr> = None;
    loop {
        let waiting = &mut *receiver;
        let told = py.detach(move || waiting.recv_timeout(LOOK_EVERY));
        let heard = match told {
            Ok(Told::Done(result)) => return (Some(result), raised),
            Ok(Told::Event(e)) => watcher
                .filter(|_| raised.is_none())
                .map_or(Ok(()), |w| w.call1(py, (e.stage, e.share, e.message)).map(|_| ())),
            Err(RecvTimeoutError::Timeout) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => return (None, raised),
        };
        if let Err(error) = heard.and_then(|()| py.check_signals()) {
            raised.get_or_insert(error);
            stop.ask();
        }
    }
}

/// The work, on threads of its own. Its last event says that all is done.
fn at_work<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, BuildError> + Send,
    jobs: Option<usize>,
    sender: &Sender<Told<T>>,
    stop: &Request,
    files: &Given,
) -> Result<T, BuildError> {
    let (teller, asked) = (sender.clone(), stop.clone());
    let last = Arc::new(Mutex::new(String::new()));
    let stage = Arc::clone(&last);
    let watcher = Arc::new(move |event: &Event| {
        if asked.is_asked() {
            resume_unwind(Box::new(Interrupted));
        }
        stage.lock().unwrap_or_else(PoisonError::into_inner).clone_from(&event.stage);
        let _ = teller.send(Told::Event(event.clone()));
    });
    let (heard, given) = (stop.clone(), files.clone());
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(jobs.unwrap_or(0))
        .stack_size(STACK)
        .start_handler(move |_| {
            heard.hear();
            given.here();
        })
        .build()
        .map_err(|e| BuildError::Machine { told: format!("no threads could be started: {e}"), place: None })?;
    let value = pool.install(|| watched(watcher, work))?;
    let stage = last.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let _ = sender.send(Told::Event(Event { stage, share: 1.0, message: "done".into() }));
    Ok(value)
}

fn exception(py: Python<'_>, failure: &Py<PyAny>, error: &BuildError) -> PyErr {
    let place = error.place();
    let at = (place.map(|p| p.file.clone()), place.and_then(|p| p.row), place.and_then(|p| p.column.clone()));
    let table = match error {
        BuildError::Faults { table, .. } => Some(table.clone()),
        _ => None,
    };
    let mut more = BTreeMap::from([("advice", genu::output::advice(error).to_owned())]);
    if let Some((key, value)) = error.setting() {
        more.extend([("key", key.to_owned()), ("value", value.to_owned())]);
    }
    match failure.call1(py, (error.code(), error.stopped_at(), error.to_string(), at, table, more)) {
        Ok(made) => PyErr::from_value(made.into_bound(py)),
        Err(error) => error,
    }
}

/// Does what the words of a command line ask for, in this process; gives what it would print.
#[pyfunction]
#[pyo3(signature = (words, failure, how=(None, None), files=BTreeMap::new()))]
fn call(
    py: Python<'_>,
    words: Vec<OsString>,
    failure: Py<PyAny>,
    how: How,
    files: BTreeMap<PathBuf, Vec<u8>>,
) -> PyResult<String> {
    let (jobs, watcher) = how;
    called(py, Calling { failure, jobs, watcher, files }, || genu::cli::call(words))
}

/// A model that was read and compiled once.
#[pyclass(frozen)]
struct Compiled(Arc<genu::simulate::Compiled>);

#[pymethods]
impl Compiled {
    /// The model at `path`, which may be among the files in memory.
    #[new]
    #[pyo3(signature = (path, failure, files=BTreeMap::new()))]
    fn new(py: Python<'_>, path: PathBuf, failure: Py<PyAny>, files: BTreeMap<PathBuf, Vec<u8>>) -> PyResult<Compiled> {
        let calling = Calling { failure, jobs: None, watcher: None, files };
        let made = called(py, calling, move || genu::simulate::Compiled::read(&path, &WhichModel::default()))?;
        Ok(Compiled(Arc::new(made)))
    }

    /// Its answers to the words after `simulate`: a CSV file, what is odd in sentences, and the same as JSON.
    #[pyo3(signature = (words, failure, how=(None, None), files=BTreeMap::new()))]
    fn simulate(
        &self,
        py: Python<'_>,
        words: Vec<OsString>,
        failure: Py<PyAny>,
        how: How,
        files: BTreeMap<PathBuf, Vec<u8>>,
    ) -> PyResult<(String, Vec<String>, String)> {
        let (jobs, watcher) = how;
        let compiled = Arc::clone(&self.0);
        called(py, Calling { failure, jobs, watcher, files }, move || {
            let answered = genu::simulate::answered(&compiled, &genu::cli::simulate_args(words)?)?;
            let told = answered.told;
            Ok((String::from_utf8_lossy(&answered.csv).into_owned(), told.warning_texts(), told.warnings_as_json()))
        })
    }
}

/// What the command tells of the model at `path`: what was done to it, its place in a build, the digest of the model and its surfaces.
#[pyfunction]
#[pyo3(signature = (path, failure, files=BTreeMap::new()))]
fn told(
    py: Python<'_>,
    path: PathBuf,
    failure: Py<PyAny>,
    files: BTreeMap<PathBuf, Vec<u8>>,
) -> PyResult<(String, String, String)> {
    called(py, Calling { failure, jobs: Some(1), watcher: None, files }, move || {
        let loaded = genu::model_file::load(&path)?;
        let told = genu::told::ModelTold::of(&loaded);
        Ok((told.standing, loaded.place(), told.digest))
    })
}

/// The text of model.json as it reads from the folder `to`, when its mesh paths are relative to the folder `from`; both absolute.
#[pyfunction]
fn moved(py: Python<'_>, text: &str, from: PathBuf, to: PathBuf, failure: Py<PyAny>) -> PyResult<String> {
    genu::model_file::moved_text(text, &from, &to).map_err(|e| exception(py, &failure, &e))
}

fn words_of(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or(payload.downcast_ref::<&str>().copied()).unwrap_or("a panic").to_owned()
}

/// The command build-model: runs the command line `words`, the program's name first; gives its exit status.
#[pyfunction]
fn main(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| genu::cli::main_of(words))
}

/// The model.json that a path means: itself, that of its folder, or the best known model of the build in it.
#[pyfunction]
#[pyo3(signature = (path, failure, as_assembled=false, source=None))]
fn model_file(
    py: Python<'_>,
    path: PathBuf,
    failure: Py<PyAny>,
    as_assembled: bool,
    source: Option<String>,
) -> PyResult<PathBuf> {
    chosen(&path, &WhichModel { as_assembled, source }).map_err(|e| exception(py, &failure, &e))
}

#[pymodule]
fn _genu(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(call, module)?)?;
    module.add_class::<Compiled>()?;
    module.add_function(wrap_pyfunction!(main, module)?)?;
    module.add_function(wrap_pyfunction!(moved, module)?)?;
    module.add_function(wrap_pyfunction!(told, module)?)?;
    module.add_function(wrap_pyfunction!(model_file, module)?)
}
