//! What the files name of their crates, without what it does there.

/// Errors of the protocol.
#[derive(Debug)]
pub enum ProtocolError {
    CallInProgress,
    Interrupted,
    FramesHeld { held: usize },
    NoField { field: String, known: String },
}

/// The process that made something: this one.
#[derive(Debug, Clone, Copy)]
pub struct Maker;

impl Maker {
    pub fn this() -> Maker {
        Maker
    }

    pub fn is_this(self) -> bool {
        true
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dtype {
    F32,
    F64,
    I32,
    U32,
    U64,
    U8,
}

#[derive(Debug, Default)]
pub struct FrameHeader {
    pub frame: u64,
}

#[derive(Debug)]
pub struct Line;

#[derive(Debug)]
pub struct Row {
    pub name: String,
    pub dtype: Dtype,
    pub shape: Vec<usize>,
    pub offset: usize,
    pub bytes: usize,
}

#[derive(Debug, Default)]
pub struct Table(Vec<Row>);

impl Table {
    pub fn row(&self, name: &str) -> Option<&Row> {
        self.0.iter().find(|row| row.name == name)
    }

    pub fn rows(&self) -> &[Row] {
        &self.0
    }
}

pub mod forked {
    pub use super::Maker;
}

pub mod port {
    #[derive(Debug)]
    pub struct Port<T>(pub T);
}

pub mod service {
    #[derive(Debug)]
    pub struct AnyThread;
}

pub mod sample {
    use std::marker::PhantomData;
    use std::sync::Arc;

    use loom::cell::UnsafeCell;

    /// A slot that its reader gives back by writing to it: loom refuses a second use at the same time.
    #[derive(Debug)]
    pub struct Sample<S, P: ?Sized, H> {
        pub slot: Arc<UnsafeCell<u32>>,
        pub kind: PhantomData<(S, H, Box<P>)>,
    }

    impl<S, P: ?Sized, H> Drop for Sample<S, P, H> {
        fn drop(&mut self) {
            self.slot.with_mut(|given_back| {
                // SAFETY: a thread that uses the slot without an order between the two fails the model.
                unsafe { *given_back += 1 }
            });
        }
    }
}

pub mod status {
    #[derive(Debug, PartialEq, Eq)]
    pub enum Status {
        StaleHandle,
        Forked,
    }

    #[derive(Debug)]
    pub struct Failure {
        pub status: Status,
        pub sentence: String,
    }

    impl Failure {
        pub fn new(status: Status, sentence: impl Into<String>) -> Failure {
            let sentence = sentence.into();
            Failure { status, sentence }
        }
    }
}

pub mod error {
    #[derive(Debug)]
    pub enum DaemonError {
        System {
            action: &'static str,
            problem: String,
        },
    }
}

pub mod terminal {
    pub fn printable(text: &str) -> &str {
        text
    }
}

pub mod signals {
    pub fn keep_writing_in_the_background() {}
}

pub mod streams {
    use std::fs::File;
    use std::io;

    pub fn stdout() -> io::Result<File> {
        Err(io::ErrorKind::Unsupported.into())
    }

    pub fn stderr() -> io::Result<File> {
        Err(io::ErrorKind::Unsupported.into())
    }
}
