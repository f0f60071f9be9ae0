//! Threads of a run: those of a pool that a program lends, and those that the system refuses to
//! start.

#![allow(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

use std::process::{Command, Stdio};

use pointmill::{Done, Graph, Overrides, Plan, Quiet, Registry, Result};
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Threads that the runs are planned for.
const PLANNED: usize = 3;

/// What a reduction writes that `run` does, and on how many threads it says that it ran.
fn reduced(run: impl FnOnce(Plan) -> Result<Done>) -> (Vec<u8>, usize) {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.laz");
    let text = format!(
        "[run]\nthreads = {PLANNED}\ntile_points = 2000\nspill = 'always'\n\
         [[stage]]\nkind = 'synth'\nscene = 'part'\npoints = 20_000\n\
         [[stage]]\nkind = 'normals'\n[[stage]]\nkind = 'cells'\n[[stage]]\nkind = 'median'\n\
         [[stage]]\nkind = 'write'\npath = '{}'\n",
        output.display()
    );
    let graph = Graph::parse(&text, "test.toml", &Registry::builtin()).unwrap();
    let done = run(graph.plan(&Overrides::default()).unwrap()).unwrap();
    (std::fs::read(&output).unwrap(), done.report.run.threads)
}

fn pool(threads: usize) -> ThreadPool {
    ThreadPoolBuilder::new().num_threads(threads).build().unwrap()
}

#[test]
fn a_run_in_a_lent_pool_writes_the_same_on_no_more_threads_than_planned() {
    let (expected, threads) = reduced(|plan| plan.run(&Quiet));
    assert_eq!(threads, PLANNED);
    assert!(expected.len() > 1000, "{} bytes", expected.len());
    for (size, works) in [(1, 1), (PLANNED, PLANNED), (6, PLANNED)] {
        let pool = pool(size);
        let (bytes, threads) = reduced(|plan| plan.run_in(&pool, &Quiet));
        assert!(bytes == expected, "a pool of {size} threads");
        assert_eq!(threads, works);
    }
}

#[test]
fn runs_that_share_a_pool_or_begin_inside_of_it_come_to_an_end() {
    let expected = reduced(|plan| plan.run(&Quiet)).0;
    let pool = pool(PLANNED);
    std::thread::scope(|scope| {
        let pool = &pool;
        let run = move || reduced(|plan| plan.run_in(pool, &Quiet)).0;
        let inside = move || pool.install(run);
        let runs = [scope.spawn(run), scope.spawn(inside), scope.spawn(run)];
        runs.into_iter().for_each(|run| assert!(run.join().unwrap() == expected));
    });
}

#[test]
fn threads_that_the_system_refuses_to_start_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let program = assert_cmd::cargo::cargo_bin("pointmill");
    // Each thread takes 2 MiB of addresses for its stack. Where what is left behind the last is too
    // little for the stack of its signals, the standard library ends the process: then another limit
    // leaves more.
    let run = |kibibytes: u32| {
        Command::new("sh")
            .current_dir(folder.path())
            .args(["-c", &format!("ulimit -v {kibibytes}; exec \"$0\" \"$@\"")])
            .arg(&program)
            .args(["synth", "part", "-n", "1000", "-o", "o.las"])
            .args(["--threads", "1000", "--memory", "60GiB"])
            .stdin(Stdio::null())
            .output()
            .unwrap()
    };
    let limits = (0..8).map(|n| 1_500_000 + 10_300 * n);
    let run = limits.map(run).find(|run| run.status.code().is_some()).expect("a run that ends");
    let told = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(1), "{told}");
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(lines[0], "error: the system refuses to start so many threads");
    assert_eq!(lines[lines.len() - 1], "help: give fewer `--threads`");
    // Once: a cause is not told as its own cause.
    assert_eq!(lines.len(), 3, "{told}");
    assert!(std::fs::read_dir(folder.path()).unwrap().next().is_none(), "something is left");
}
