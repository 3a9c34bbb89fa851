//! Looking who is there.

/// A port that cannot be reached. As in iceoryx2 with its usual handlers, no call returns it: that port is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ConnectionFailure {
    /// The connection could not be made.
    FailedToEstablishConnection,
    /// The memory of the sender is not there.
    UnableToMapSendersDataSegment,
}

/// Ports that meet others.
pub trait UpdateConnections {
    /// Looks who is there, if somebody came or went.
    ///
    /// # Errors
    /// None here.
    fn update_connections(&self) -> Result<(), ConnectionFailure>;
}
