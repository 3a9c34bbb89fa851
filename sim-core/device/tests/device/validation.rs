//! Vulkan's validation layer watches all tests (`layer`), and would not be overheard.

use crate::layer::assert_watched;
use std::process::Command;

#[test]
fn what_the_validation_layer_says_fails_the_test() {
    let forbidden = "validation::something_forbidden";
    let run = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "--ignored", forbidden])
        .output()
        .unwrap();
    let printed = String::from_utf8_lossy(&run.stdout).into_owned();
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    // the test itself finds nothing wrong
    assert!(printed.contains("1 passed"), "{printed}");
    assert!(!run.status.success(), "{said}");
    for word in ["VUID-VkBufferCreateInfo-size-00912", "SYNC-HAZARD"] {
        assert!(said.contains(word), "{word}: {said}");
    }
}

#[test]
fn the_validation_layer_watches() {
    let _device = crate::common::device();
    assert_watched();
}

/// What the layer must not overlook, and lavapipe takes without a word: a buffer of no size, and two writes without a barrier.
/// Instances made before and after show that none hides messages of another's layer.
#[test]
#[ignore = "run by what_the_validation_layer_says_fails_the_test"]
fn something_forbidden() {
    let _ = sim_device::adapters();
    forbidden();
    let _ = sim_device::adapters();
}

fn forbidden() {
    use ash::vk;
    // SAFETY: the loader stays loaded; what is wrong here is what the layer is asked to find.
    unsafe {
        let entry = ash::Entry::load().unwrap();
        let version = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_1);
        let wanted = vk::InstanceCreateInfo::default().application_info(&version);
        let instance = entry.create_instance(&wanted, None).unwrap();
        let physical = instance.enumerate_physical_devices().unwrap()[0];
        let queues = [vk::DeviceQueueCreateInfo::default().queue_priorities(&[1.0])];
        let wanted = vk::DeviceCreateInfo::default().queue_create_infos(&queues);
        let device = instance.create_device(physical, &wanted, None).unwrap();
        let wanted = vk::BufferCreateInfo::default().usage(vk::BufferUsageFlags::TRANSFER_DST);
        if let Ok(buffer) = device.create_buffer(&wanted, None) {
            device.destroy_buffer(buffer, None);
        }

        let buffer = device.create_buffer(&wanted.size(256), None).unwrap();
        let needs = device.get_buffer_memory_requirements(buffer);
        let kind = needs.memory_type_bits.trailing_zeros();
        let wanted = vk::MemoryAllocateInfo::default()
            .allocation_size(needs.size)
            .memory_type_index(kind);
        let memory = device.allocate_memory(&wanted, None).unwrap();
        device.bind_buffer_memory(buffer, memory, 0).unwrap();
        let pool = device
            .create_command_pool(&vk::CommandPoolCreateInfo::default(), None)
            .unwrap();
        let wanted = vk::CommandBufferAllocateInfo::default()
            .command_pool(pool)
            .command_buffer_count(1);
        let commands = device.allocate_command_buffers(&wanted).unwrap()[0];
        device
            .begin_command_buffer(commands, &vk::CommandBufferBeginInfo::default())
            .unwrap();
        device.cmd_fill_buffer(commands, buffer, 0, 256, 1);
        device.cmd_fill_buffer(commands, buffer, 0, 256, 2);
        device.end_command_buffer(commands).unwrap();
        device.destroy_command_pool(pool, None);
        device.destroy_buffer(buffer, None);
        device.free_memory(memory, None);
        device.destroy_device(None);
        instance.destroy_instance(None);
    }
}
