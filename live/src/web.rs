//! The doors of the WebAssembly module: plain functions and memory, no binding of another tool.
//!
//! The page asks for [`room`], writes there, and calls [`open`] with a pack or [`ask`] with a request. The reply is JSON in memory, at
//! [`reply`], [`reply_length`] bytes long. All runs on the one thread that called.
#![expect(
    unsafe_code,
    reason = "an exported name must be unique in the module, which the compiler cannot check; nothing else is unsafe here"
)]

use crate::ask::{answer, fault};
use crate::knee::Knee;
use std::cell::RefCell;

#[derive(Default)]
struct Desk {
    input: Vec<u8>,
    output: Vec<u8>,
    knee: Option<Knee>,
}

thread_local! {
    static DESK: RefCell<Desk> = RefCell::default();
}

/// Room for `length` bytes, to be written before the next call.
#[unsafe(no_mangle)]
pub extern "C" fn room(length: usize) -> *mut u8 {
    DESK.with_borrow_mut(|desk| {
        desk.input = vec![0; length];
        desk.input.as_mut_ptr()
    })
}

/// Opens the pack that was written.
#[unsafe(no_mangle)]
pub extern "C" fn open() {
    DESK.with_borrow_mut(|desk| {
        let bytes = std::mem::take(&mut desk.input);
        match Knee::open(&bytes) {
            Ok(knee) => {
                desk.output = answer(&knee, br#"{"about":{}}"#);
                desk.knee = Some(knee);
            }
            Err(what) => desk.output = fault(&what),
        }
    });
}

/// Answers the request that was written.
#[unsafe(no_mangle)]
pub extern "C" fn ask() {
    DESK.with_borrow_mut(|desk| {
        desk.output = match &desk.knee {
            Some(knee) => answer(knee, &desk.input),
            None => fault("no knee is open"),
        };
    });
}

/// Where the reply lies.
#[unsafe(no_mangle)]
pub extern "C" fn reply() -> *const u8 {
    DESK.with_borrow(|desk| desk.output.as_ptr())
}

/// How long it is [bytes].
#[unsafe(no_mangle)]
pub extern "C" fn reply_length() -> usize {
    DESK.with_borrow(|desk| desk.output.len())
}
