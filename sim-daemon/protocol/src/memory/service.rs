//! The transport's services over our own [`Storage`]: for one thread at the daemon, for any thread at a client.

use std::fmt::Debug;

use iceoryx2::service::Service;
use iceoryx2::service::internal::ServiceInternal;
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;
use iceoryx2_bb_lock_free::mpmc::counting_bit_set::RelocatableCountingBitSet;
use iceoryx2_cal::arc_sync_policy::single_threaded::SingleThreaded;
use iceoryx2_cal::event::trigger::{State, unix_datagram_socket::GenericUnixDatagramSocketTrigger};
use iceoryx2_cal::resizable_shared_memory::dynamic::DynamicMemory;
use iceoryx2_cal::shared_memory::common::details::{AllocatorDetails, Memory};
use iceoryx2_cal::shm_allocator::bump_allocator::BumpAllocator;
use iceoryx2_cal::shm_allocator::pool_allocator::PoolAllocator;
use iceoryx2_cal::zero_copy_connection::common::details::{Connection, SharedManagementData};
use iceoryx2_cal::{bag, hash, monitoring, reactor, serialize, static_storage};

use crate::memory::reentrant::Reentrant;
use crate::memory::storage::Storage;

/// Memory of payloads.
type Payload<Allocator> = Memory<Allocator, Storage<AllocatorDetails<Allocator>>>;
/// What a notifier and a listener share.
type EventState = State<RelocatableCountingBitSet, ()>;

/// A kind of service: iceoryx2's `ipc`, with memory from [`Storage`].
macro_rules! service {
    ($(#[$text:meta])* $name:ident, $policy:ident) => {
        $(#[$text])*
        #[derive(Debug, Clone)]
        pub struct $name;

        impl Service for $name {
            type StaticStorage = static_storage::recommended::Ipc;
            type ConfigSerializer = serialize::recommended::Recommended;
            type PersistentDynamicStorage<T: Debug + Send + Sync + ZeroCopySend + 'static> = Storage<T>;
            type Bag = bag::recommended::Recommended;
            type DynamicStorage<T: Debug + Send + Sync + ZeroCopySend + 'static> = Storage<T>;
            type ServiceNameHasher = hash::recommended::Recommended;
            type SharedMemory = Payload<PoolAllocator>;
            type ResizableSharedMemory = DynamicMemory<PoolAllocator, Payload<PoolAllocator>>;
            type Connection = Connection<Storage<SharedManagementData>>;
            type Event = GenericUnixDatagramSocketTrigger<RelocatableCountingBitSet, Storage<EventState>>;
            type Monitoring = monitoring::recommended::Ipc;
            type Reactor = reactor::recommended::Ipc;
            type ArcThreadSafetyPolicy<T: Send + Debug + Abandonable> = $policy<T>;
            type BlackboardMgmt<T: Send + Sync + Debug + ZeroCopySend + 'static> = Storage<T>;
            type BlackboardPayload = Payload<BumpAllocator>;
            type UniqueId = iceoryx2::unique_id_generator::unique_system_id::UniqueSystemId;
        }

        impl ServiceInternal<$name> for $name {}
    };
}

service!(
    /// Services whose ports stay on one thread.
    OneThread, SingleThreaded
);
service!(
    /// Services whose ports and samples go to any thread.
    AnyThread, Reentrant
);
