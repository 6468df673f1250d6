//! `genu._genu`: the commands of build-model, called from Python. Everything that has a shape is in `python/genu/`.

use genu::error::BuildError;
use genu::progress::{Event, watched};
use genu::which_model::{WhichModel, chosen};
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError};
use pyo3::prelude::*;
use sim::interrupt::{self, Interrupted};
use std::any::Any;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;

/// How often Python may look for Ctrl-C while the work goes on.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// Stack of the thread that works [bytes]: that of a main thread, for which the program is made.
const STACK: usize = 8 << 20;

/// What the working thread tells the one that waits.
enum Told {
    Event(Event),
    Done(thread::Result<Result<String, BuildError>>),
}

/// Works at once, so that a request to stop is taken back when the last of them has heard it.
static AT_WORK: AtomicUsize = AtomicUsize::new(0);

/// Does what the words of a command line ask for, in this process and without Python's lock.
///
/// `jobs` is the number of threads (all where None); `watcher(stage, share, message)` is called on this thread.
/// `failure(kind, stage, message)` makes the exception that is raised, of kind "stage", "file", "option" or "usage".
#[pyfunction]
#[pyo3(signature = (words, failure, jobs=None, watcher=None))]
fn call(
    py: Python<'_>,
    words: Vec<OsString>,
    failure: Py<PyAny>,
    jobs: Option<usize>,
    watcher: Option<Py<PyAny>>,
) -> PyResult<String> {
    let (sender, mut receiver) = channel();
    let stop = Arc::new(AtomicBool::new(false));
    AT_WORK.fetch_add(1, Ordering::SeqCst);
    let heard = Arc::clone(&stop);
    let begun = thread::Builder::new().name("genu".into()).stack_size(STACK).spawn(move || {
        let result = catch_unwind(AssertUnwindSafe(|| work(words, jobs, &sender, heard)));
        let _ = sender.send(Told::Done(result));
    });
    if let Err(e) = begun {
        AT_WORK.fetch_sub(1, Ordering::SeqCst);
        return Err(PyRuntimeError::new_err(format!("no thread could be started: {e}")));
    }
    let (done, raised) = wait(py, &mut receiver, watcher.as_ref(), &stop);
    if AT_WORK.fetch_sub(1, Ordering::SeqCst) == 1 {
        interrupt::withdraw();
    }
    if let Some(raised) = raised {
        return Err(raised);
    }
    match done {
        Some(Ok(Ok(text))) => Ok(text),
        Some(Ok(Err(error))) => Err(exception(py, &failure, &error)),
        Some(Err(payload)) if payload.is::<Interrupted>() => Err(PyKeyboardInterrupt::new_err("stopped")),
        Some(Err(payload)) => {
            Err(PyRuntimeError::new_err(format!("internal error, please report it: {}", words_of(&*payload))))
        }
        None => Err(PyRuntimeError::new_err("internal error, please report it: the work ended without a word")),
    }
}

/// Waits for the end of the work; passes events on, and Python's signals as a request to stop.
fn wait(
    py: Python<'_>,
    receiver: &mut Receiver<Told>,
    watcher: Option<&Py<PyAny>>,
    stop: &AtomicBool,
) -> (Option<thread::Result<Result<String, BuildError>>>, Option<PyErr>) {
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
            stop.store(true, Ordering::SeqCst);
            interrupt::ask();
        }
    }
}

/// The work, on a thread of its own and with as many as `jobs` says.
fn work(
    words: Vec<OsString>,
    jobs: Option<usize>,
    sender: &Sender<Told>,
    stop: Arc<AtomicBool>,
) -> Result<String, BuildError> {
    let teller = sender.clone();
    let watcher = Arc::new(move |event: &Event| {
        if stop.load(Ordering::SeqCst) {
            resume_unwind(Box::new(Interrupted));
        }
        let _ = teller.send(Told::Event(event.clone()));
    });
    let called = || watched(watcher, || genu::cli::call(words));
    match jobs {
        None => called(),
        Some(n) => rayon::ThreadPoolBuilder::new()
            .num_threads(n)
            .stack_size(STACK)
            .build()
            .map_err(|e| BuildError::Option(format!("jobs: {e}")))?
            .install(called),
    }
}

fn exception(py: Python<'_>, failure: &Py<PyAny>, error: &BuildError) -> PyErr {
    let (kind, stage) = match error {
        BuildError::Stage { stage, .. } => ("stage", Some(*stage)),
        BuildError::File(_) | BuildError::Faults { .. } => ("file", None),
        BuildError::Machine(_) => ("machine", None),
        BuildError::Option(_) => ("option", None),
        BuildError::Usage(_) => ("usage", None),
        BuildError::Unplanned(stage) => ("stage", Some(*stage)),
        BuildError::Reached => ("stage", None),
    };
    match failure.call1(py, (kind, stage, error.to_string())) {
        Ok(made) => PyErr::from_value(made.into_bound(py)),
        Err(error) => error,
    }
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
    module.add_function(wrap_pyfunction!(main, module)?)?;
    module.add_function(wrap_pyfunction!(model_file, module)?)
}
