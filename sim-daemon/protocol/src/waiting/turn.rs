//! Taking turns on a value: a call has it for itself, but no lock, while it waits and the caller's own code may run.

use std::ops::{Deref, DerefMut};

use crate::ProtocolError;
use crate::doors::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use crate::doors::thread::{self, ThreadId};
use crate::waiting::SLICE;
use crate::waiting::hook::Hook;

/// Nothing of ours is left half-written when a thread panics: a poisoned lock is as good as any.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A value that one call at a time uses. Others wait for their turn in the hook's rhythm; a call that the same thread makes
/// inside a call, from its hook, gets an error instead.
#[derive(Debug)]
pub(crate) struct Turn<T> {
    state: Mutex<State<T>>,
    left: Condvar,
}

#[derive(Debug)]
struct State<T> {
    /// None while a call has it.
    value: Option<T>,
    holder: Option<ThreadId>,
    waiting: usize,
    /// It is for one of those who wait, not for a call that comes just now.
    passed_on: bool,
}

/// The value for as long as a call takes.
#[derive(Debug)]
pub(crate) struct Held<'a, T> {
    turn: &'a Turn<T>,
    value: Option<T>,
}

impl<T> Turn<T> {
    pub(crate) fn new(value: T) -> Turn<T> {
        let state = State {
            value: Some(value),
            holder: None,
            waiting: 0,
            passed_on: false,
        };
        Turn {
            state: Mutex::new(state),
            left: Condvar::new(),
        }
    }

    /// Waits for the value.
    ///
    /// # Errors
    /// [`ProtocolError::CallInProgress`] when this thread has it already; [`ProtocolError::Interrupted`].
    pub(crate) fn take(&self, hook: Hook<'_>) -> Result<Held<'_, T>, ProtocolError> {
        let me = thread::this();
        let mut state = lock(&self.state);
        if state.holder == Some(me) {
            return Err(ProtocolError::CallInProgress);
        }
        if state.value.is_none() || state.passed_on {
            // under the same lock: who leaves must see us wait
            return self.wait(state, me, hook);
        }
        Ok(self.hand_over(&mut state, me))
    }

    fn wait<'a>(
        &'a self,
        mut state: MutexGuard<'a, State<T>>,
        me: ThreadId,
        hook: Hook<'_>,
    ) -> Result<Held<'a, T>, ProtocolError> {
        state.waiting += 1;
        loop {
            state = self
                .left
                .wait_timeout(state, SLICE)
                .unwrap_or_else(PoisonError::into_inner)
                .0;
            if state.value.is_none() {
                drop(state);
                let interrupted = hook().is_break();
                state = lock(&self.state);
                if interrupted {
                    state.waiting -= 1;
                    self.pass_on(&mut state);
                    return Err(ProtocolError::Interrupted);
                }
            }
            // it may have come while the hook ran, and nobody is notified twice
            if state.value.is_some() {
                state.waiting -= 1;
                state.passed_on = false;
                return Ok(self.hand_over(&mut state, me));
            }
        }
    }

    fn hand_over(&self, state: &mut State<T>, to: ThreadId) -> Held<'_, T> {
        state.holder = Some(to);
        Held {
            turn: self,
            value: state.value.take(),
        }
    }

    /// Lets one of those who wait have a value that is there.
    fn pass_on(&self, state: &mut State<T>) {
        state.passed_on = state.value.is_some() && state.waiting > 0;
        if state.passed_on {
            self.left.notify_one();
        }
    }

    /// A look at the value between calls; `None` while one has it.
    pub(crate) fn look<R>(&self, at: impl FnOnce(&T) -> R) -> Option<R> {
        lock(&self.state).value.as_ref().map(at)
    }

    /// The value, from its owner, unless a call of another thread has it.
    pub(crate) fn value(&mut self) -> Option<&mut T> {
        let state = self.state.get_mut();
        state.unwrap_or_else(PoisonError::into_inner).value.as_mut()
    }
}

impl<T> Drop for Held<'_, T> {
    fn drop(&mut self) {
        let mut state = lock(&self.turn.state);
        state.value = self.value.take();
        state.holder = None;
        self.turn.pass_on(&mut state);
    }
}

impl<T> Deref for Held<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        self.value.as_ref().expect("held until dropped")
    }
}

impl<T> DerefMut for Held<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        self.value.as_mut().expect("held until dropped")
    }
}

#[cfg(all(test, not(any(loom, simulated))))]
mod tests {
    use super::*;
    use crate::waiting::hook::keep_waiting;
    use std::ops::ControlFlow;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn a_call_inside_a_call_is_refused_and_one_after_it_is_not() {
        let turn = Turn::new(1);
        let mut held = turn.take(&mut keep_waiting()).unwrap();
        let inside = turn.take(&mut keep_waiting()).map(|_| ());
        assert!(
            matches!(inside, Err(ProtocolError::CallInProgress)),
            "{inside:?}"
        );
        *held += 1;
        drop(held);
        assert_eq!(*turn.take(&mut keep_waiting()).unwrap(), 2);
    }

    #[test]
    fn who_waits_can_be_interrupted_and_leaves_the_turn_to_others() {
        let turn = Turn::new(());
        let held = turn.take(&mut keep_waiting()).unwrap();
        std::thread::scope(|scope| {
            let interrupted = scope.spawn(|| turn.take(&mut || ControlFlow::Break(())).map(|_| ()));
            assert!(matches!(
                interrupted.join().unwrap(),
                Err(ProtocolError::Interrupted)
            ));
            let patient = scope.spawn(|| turn.take(&mut keep_waiting()).map(|_| ()));
            drop(held);
            patient.join().unwrap().unwrap();
        });
        assert!(turn.take(&mut keep_waiting()).is_ok());
    }

    #[test]
    fn a_thread_that_takes_turn_after_turn_starves_nobody() {
        let (turn, turns) = (Turn::new(()), AtomicUsize::new(0));
        std::thread::scope(|scope| {
            let busy = scope.spawn(|| {
                while turns.load(Ordering::Relaxed) < 20 {
                    drop(turn.take(&mut keep_waiting()).unwrap());
                }
            });
            for _ in 0..20 {
                drop(turn.take(&mut keep_waiting()).unwrap());
                turns.fetch_add(1, Ordering::Relaxed);
            }
            busy.join().unwrap();
        });
    }
}

/// In every order; a wait that nobody ends fails, since time never passes there but for [`time_passes`].
#[cfg(all(test, loom))]
mod models {
    use super::*;
    use crate::waiting::hook::keep_waiting;
    use loom::sync::Arc;
    use std::ops::ControlFlow;

    /// Ends the waits of those who wait now.
    fn time_passes<T>(turn: &Turn<T>) {
        turn.left.notify_all();
    }

    #[test]
    fn each_call_has_the_value_for_itself_and_gets_its_turn() {
        loom::model(|| {
            let turn = Arc::new(Turn::new(0));
            let others = [0; 2].map(|_| {
                let turn = Arc::clone(&turn);
                thread::spawn(move || *turn.take(&mut keep_waiting()).unwrap() += 1)
            });
            *turn.take(&mut keep_waiting()).unwrap() += 1;
            for other in others {
                other.join().unwrap();
            }
            assert_eq!(turn.look(|value| *value), Some(3));
        });
    }

    #[test]
    fn a_wait_that_is_interrupted_takes_nobody_his_turn() {
        loom::model(|| {
            let turn = Arc::new(Turn::new(0));
            let held = turn.take(&mut keep_waiting()).unwrap();
            let patient = thread::spawn({
                let turn = Arc::clone(&turn);
                move || *turn.take(&mut keep_waiting()).unwrap() += 1
            });
            let interrupted = thread::spawn({
                let turn = Arc::clone(&turn);
                // it has its turn where the value comes before it looks at the hook
                move || match turn.take(&mut || ControlFlow::Break(())) {
                    Ok(_) | Err(ProtocolError::Interrupted) => {}
                    Err(error) => panic!("{error:?}"),
                }
            });
            time_passes(&turn);
            drop(held);
            patient.join().unwrap();
            interrupted.join().unwrap();
            assert_eq!(turn.look(|value| *value), Some(1));
        });
    }

    #[test]
    fn a_call_inside_a_call_is_refused_while_others_wait() {
        loom::model(|| {
            let turn = Arc::new(Turn::new(()));
            let held = turn.take(&mut keep_waiting()).unwrap();
            let other = thread::spawn({
                let turn = Arc::clone(&turn);
                move || turn.take(&mut keep_waiting()).map(|_| ())
            });
            let inside = turn.take(&mut keep_waiting()).map(|_| ());
            assert!(matches!(inside, Err(ProtocolError::CallInProgress)));
            drop(held);
            other.join().unwrap().unwrap();
        });
    }
}
