//! What programs may be, how long they may take, and what is kept of them.

use crate::common::{PATIENCE, copy, device, numbers, program, scale_add, staged, ways};
use sim_device::{AdapterKind, Choice, Device, DeviceError, Replay, Source};
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

/// `a[i]` is the sum of many terms, each of which needs the one before: `statements` of them, which no compiler shortens.
fn monster(statements: usize) -> Source {
    let mut lines = String::from("var x = a[id.x];");
    for i in 0..statements {
        lines += &format!(
            "x = fma(x, {:?}, sqrt(abs(x) + {:?}));\n",
            1.0 / (i + 2) as f32,
            i as f32
        );
    }
    Source {
        label: "monster".to_owned(),
        wgsl: format!(
            "@group(0) @binding(0) var<storage, read_write> a: array<f32>;
            @compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3<u32>) {{ {lines} a[id.x] = x; }}"
        ),
        entry: "main".to_owned(),
        constants: Vec::new(),
    }
}

fn altered(change: impl Fn(&mut Source)) -> Source {
    let mut source = scale_add(2.0, 8);
    change(&mut source);
    source
}

/// A path of its own, where nothing is: these tests run in several processes at once.
fn folder(name: &str) -> PathBuf {
    let name = format!("{name}-{}", std::process::id());
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    folder
}

#[test]
fn overrides_take_the_values_that_are_given() {
    for (device, replay) in ways() {
        for (factor, workgroup, count) in [(2.0, 32, 1000), (-3.5, 8, 7), (0.25, 1, 1)] {
            let mut source = scale_add(factor, count);
            let size = ("workgroup".to_owned(), f64::from(workgroup));
            source.constants.push(size);
            let add = program(&device, source);
            let (a, b) = (staged(&device, &[4.0; 1000]), staged(&device, &[1.0; 1000]));
            let mut batch = device.batch(replay);
            let groups = count.div_ceil(workgroup);
            batch.dispatch(&add, &[(0, &a, 0..4000), (3, &b, 0..4000)], groups);
            device.run(&[&batch.finish().unwrap()]).unwrap();
            let (sum, rest) = (4.0 * factor as f32 + 1.0, 1000 - count as usize);
            let wanted = [vec![sum; count as usize], vec![1.0; rest]].concat();
            assert_eq!(numbers(&b), wanted);
        }
    }
}

#[test]
fn a_broken_program_is_refused_with_its_name_and_reason() {
    let cases = [
        (
            altered(|s| s.wgsl = s.wgsl.replace("a[id.x] *", "a[id.y] * nothing *")),
            "nothing",
        ),
        (
            altered(|s| s.wgsl = s.wgsl.replace("count: u32", "count: f32")),
            "Less",
        ),
        (altered(|s| s.entry = "other".to_owned()), "`other`"),
        (altered(|s| s.constants.clear()), "count"),
        (
            altered(|s| s.constants.push(("unknown".to_owned(), 1.0))),
            "unknown",
        ),
        (
            altered(|s| s.wgsl = s.wgsl.replace("group(0)", "group(1)")),
            "group 1",
        ),
        (
            altered(|s| s.constants.push(("workgroup".to_owned(), 1e6))),
            "orkgroup",
        ),
        (
            altered(|s| {
                s.wgsl = "@compute @workgroup_size(1) fn step() {}".to_owned();
                s.constants.clear();
            }),
            "no storage",
        ),
    ];
    for (device, _) in ways() {
        for (source, word) in &cases {
            let sources = [scale_add(1.0, 1), source.clone()];
            let failure = device.programs(&sources, PATIENCE).err().expect(word);
            let DeviceError::Compile { label, reason } = &failure else {
                panic!("{word}: {failure}");
            };
            assert_eq!(label, "scale_add");
            assert!(reason.contains(word), "{word}: {reason}");
        }
        program(&device, scale_add(1.0, 1));
    }
}

#[test]
fn programs_keep_their_order() {
    let device = device();
    let sources: Vec<Source> = (0..40)
        .map(|i| {
            let mut source = if i == 0 {
                monster(2000)
            } else {
                scale_add(f64::from(i), 1)
            };
            source.label = format!("program {i}");
            source
        })
        .collect();
    let programs = device.programs(&sources, PATIENCE).unwrap();
    for (i, program) in programs.iter().enumerate().skip(1) {
        assert_eq!(program.label(), format!("program {i}"));
        let (a, b) = (staged(&device, &[1.0]), staged(&device, &[0.0]));
        let mut batch = device.batch(Replay::Recorded);
        batch.dispatch(program, &[(0, &a, 0..4), (3, &b, 0..4)], 1);
        device.run(&[&batch.finish().unwrap()]).unwrap();
        assert_eq!(numbers(&b), [i as f32]);
    }
}

#[test]
fn a_driver_that_takes_too_long_is_given_up() {
    let device = device();
    let limit = Duration::from_millis(1);
    let failure = device.programs(&[monster(5_000)], limit).err().unwrap();
    let wanted = DeviceError::CompileTimeout {
        label: "monster".to_owned(),
        limit,
    };
    assert_eq!(format!("{failure:?}"), format!("{wanted:?}"));
    // the device goes on while the abandoned thread compiles
    assert_eq!(device.compiling(), 1);
    program(&device, scale_add(1.0, 1));
    while device.compiling() > 0 {
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn what_a_driver_puts_off_until_a_first_run_is_within_the_limit() {
    let device = device();
    if device.info().kind != AdapterKind::Software {
        eprintln!("skipped: who else puts it off is not known");
        return;
    }
    // kernel source that the driver's cache does not know: its pipeline takes 50 ms, its first run seconds
    let mut source = monster(4000);
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    let salt = format!("a[id.x] + {}.0", now.unwrap().subsec_nanos());
    source.wgsl = source.wgsl.replace("a[id.x];", &format!("{salt};"));
    let failure = device.programs(&[source], Duration::from_millis(300)).err();
    assert!(
        matches!(failure, Some(DeviceError::CompileTimeout { .. })),
        "{failure:?}"
    );
    while device.compiling() > 0 {
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn a_second_run_finds_its_programs_and_a_damaged_file_is_written_anew() {
    let folder = folder("cache");
    let sources = [scale_add(2.0, 8), scale_add(3.0, 8), monster(100)];
    let open = || Device::open(&Choice::First, Some(&folder)).unwrap();
    let files = || {
        let mut files: Vec<_> = std::fs::read_dir(&folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .map(|path| (std::fs::read(&path).unwrap(), path))
            .collect();
        files.sort();
        files
    };
    let check = |device: &Device| {
        let programs = device.programs(&sources, PATIENCE).unwrap();
        let (a, b) = (staged(device, &[5.0; 8]), staged(device, &[0.0; 8]));
        let mut batch = device.batch(Replay::Recorded);
        for program in &programs[..2] {
            batch.dispatch(program, &[(0, &a, 0..32), (3, &b, 0..32)], 1);
        }
        device.run(&[&batch.finish().unwrap()]).unwrap();
        assert_eq!(numbers(&b), [25.0; 8]);
        device.cached()
    };
    assert_eq!(check(&open()), 0);
    let first = files();
    assert_eq!(
        first.len(),
        sources.len() + 1,
        "words of each, and the driver's data"
    );
    assert_eq!(check(&open()), sources.len());
    assert_eq!(files(), first);

    let damages: [fn(&mut Vec<u8>); 4] = [
        |bytes| bytes.clear(),
        |bytes| bytes.truncate(bytes.len() / 2),
        |bytes| *bytes.last_mut().unwrap() ^= 1,
        |bytes| bytes[17] ^= 0x80,
    ];
    for damage in damages {
        for (bytes, path) in &first {
            let mut bytes = bytes.clone();
            damage(&mut bytes);
            std::fs::write(path, bytes).unwrap();
        }
        assert_eq!(check(&open()), 0);
        assert_eq!(files().len(), first.len());
        assert_eq!(check(&open()), sources.len());
    }
    // words of one program under the name of another
    let words: Vec<_> = first
        .iter()
        .filter(|(_, path)| path.to_str().unwrap().contains("program-"))
        .collect();
    std::fs::write(&words[0].1, &words[1].0).unwrap();
    assert_eq!(check(&open()), sources.len() - 1);
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_cache_that_cannot_be_written_is_done_without() {
    let folder = folder("no-folder");
    std::fs::write(&folder, "a file").unwrap();
    let device = Device::open(&Choice::First, Some(&folder)).unwrap();
    let buffer = device.buffer("b", 16).unwrap();
    let staging = staged(&device, &[1.0; 4]);
    program(&device, scale_add(1.0, 1));
    device
        .run(&[&copy(&device, Replay::Recorded, &staging, &buffer)])
        .unwrap();
    assert_eq!(device.cached(), 0);
    std::fs::remove_file(&folder).unwrap();
}
