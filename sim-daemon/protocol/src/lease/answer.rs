//! What a client reads out of the payload of an answer.

use crate::doors::sync::Arc;
use crate::{ProtocolError, RefusalKind, Table};

/// Checks the table of a frame, unless one of the same schema was checked before: the daemon lays out every frame alike.
///
/// Either way what is read lies inside the payload, whatever the daemon wrote.
pub(crate) fn check_table(
    known: &mut Option<Arc<Table>>,
    payload: &[u64],
    rows: u32,
) -> Result<Arc<Table>, ProtocolError> {
    if let Some(table) = known
        && table.rows().len() == rows as usize
        && table.total_bytes() <= size_of_val(payload)
    {
        return Ok(Arc::clone(table));
    }
    let malformed = |problem| ProtocolError::Malformed {
        from: "the daemon",
        problem,
    };
    let table = Arc::new(Table::parse(payload, rows).map_err(malformed)?);
    Ok(Arc::clone(known.insert(table)))
}

/// The daemon's sentence out of a refusal.
pub(super) fn refusal(outcome: u32, rows: u32, payload: &[u64]) -> ProtocolError {
    let read = || {
        let table = Table::parse(payload, rows)?;
        let row = table.row("reason").ok_or("a refusal without reason")?;
        let bytes: &[u8] = bytemuck::cast_slice(payload);
        Ok::<_, String>(
            String::from_utf8_lossy(&bytes[row.offset..row.offset + row.bytes]).into_owned(),
        )
    };
    match read() {
        Ok(reason) => ProtocolError::CommandRefused {
            kind: RefusalKind::from_code(outcome),
            reason,
        },
        Err(problem) => ProtocolError::Malformed {
            from: "the daemon",
            problem,
        },
    }
}
