//! Provenance: by what, on what and at what cost a result was made. Kept beside the results, never an input of one.

use crate::tables::list::ProvenanceRow;
use cpu_time::{ProcessTime, ThreadTime};
use std::sync::LazyLock;
use std::time::{Duration, Instant};

/// A stopwatch for wall and processor time.
pub struct Stopwatch {
    start: Instant,
    cpu: Option<Cpu>,
}

enum Cpu {
    Thread(ThreadTime),
    Process(ProcessTime),
}

impl Stopwatch {
    /// Counts the processor time of this thread.
    pub fn of_thread() -> Self {
        Self { start: Instant::now(), cpu: ThreadTime::try_now().ok().map(Cpu::Thread) }
    }

    /// Counts the processor time of all threads.
    pub fn of_process() -> Self {
        Self { start: Instant::now(), cpu: ProcessTime::try_now().ok().map(Cpu::Process) }
    }

    /// What `key` cost until now. `subject` is `run` or `stage`, `name` the experiment or the stage.
    pub fn stop(&self, key: String, subject: &str, name: &str) -> ProvenanceRow {
        ProvenanceRow {
            key,
            subject: subject.to_owned(),
            name: name.to_owned(),
            wall_s: self.start.elapsed().as_secs_f64(),
            cpu_s: self.cpu().as_ref().map(Duration::as_secs_f64),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: env!("GRANULAKE_COMMIT").to_owned(),
            compiler: env!("GRANULAKE_COMPILER").to_owned(),
            target: env!("GRANULAKE_TARGET").to_owned(),
            processor: PROCESSOR.clone(),
        }
    }

    fn cpu(&self) -> Option<Duration> {
        match self.cpu.as_ref()? {
            Cpu::Thread(start) => start.try_elapsed().ok(),
            Cpu::Process(start) => start.try_elapsed().ok(),
        }
    }
}

/// Model of the processor as Linux tells it, else its architecture.
static PROCESSOR: LazyLock<String> = LazyLock::new(|| {
    let told = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = told.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    model.map_or_else(|| std::env::consts::ARCH.to_owned(), |(_, name)| name.trim().to_owned())
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_busy_thread_costs_its_own_time_and_a_sleeping_one_none() {
        let watch = Stopwatch::of_thread();
        std::thread::sleep(Duration::from_millis(30));
        let asleep = watch.stop("k".to_owned(), "run", "pile");
        assert!(asleep.wall_s >= 0.03 && asleep.cpu_s.is_some_and(|cpu| cpu < 0.02), "{asleep:?}");
        let mut sum = 0_u64;
        while watch.cpu().is_some_and(|cpu| cpu < Duration::from_millis(20)) {
            sum = std::hint::black_box(sum.wrapping_add(1));
        }
        let busy = watch.stop("k".to_owned(), "run", "pile");
        assert!(busy.cpu_s >= Some(0.02) && busy.wall_s >= busy.cpu_s.unwrap_or_default());
        assert!(!busy.processor.is_empty() && busy.compiler.starts_with("rustc "));
    }
}
