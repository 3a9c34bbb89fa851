//! Why a command is refused, as clients get it.

use sim_engine::backend::BackendError;
use sim_protocol::RefusalKind;

/// Why a command is not carried out; nothing was changed.
#[derive(Debug)]
pub(crate) struct Refusal {
    pub(crate) kind: RefusalKind,
    pub(crate) reason: String,
}

pub(crate) fn refusal(kind: RefusalKind, reason: String) -> Refusal {
    Refusal { kind, reason }
}

impl From<BackendError> for Refusal {
    fn from(error: BackendError) -> Refusal {
        let kind = match error {
            BackendError::NotFinite { .. } => RefusalKind::NotFinite,
            BackendError::Columns { .. }
            | BackendError::Length { .. }
            | BackendError::Mask { .. }
            | BackendError::Seeds { .. } => RefusalKind::Shape,
            BackendError::Group { .. } | BackendError::Constant { .. } => RefusalKind::Field,
            _ => RefusalKind::Backend,
        };
        refusal(kind, error.to_string())
    }
}
