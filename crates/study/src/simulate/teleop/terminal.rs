//! The terminal of a tele-operation: keys in, pictures out, a control step every 50 ms whatever the
//! picture costs.
//!
//! Pictures are made and written by a thread of their own, always of the newest state; a slow
//! terminal or a large picture costs pictures, never control steps. Everything is drawn on stderr:
//! stdout is for `--json`.

use super::keys::{Command, Key, Stroke};
use super::screen;
use super::session::{Session, Status};
use crossterm::event::{
    self, DisableFocusChange, EnableFocusChange, Event, KeyCode, KeyEventKind, KeyModifiers, KeyboardEnhancementFlags,
    PopKeyboardEnhancementFlags, PushKeyboardEnhancementFlags,
};
use crossterm::{cursor, execute, terminal};
use hingecast::failure::{Failure, Result};
use hingecast_geom::{Cancelled, Progress};
use hingecast_policy::Demos;
use hingecast_sim::{Env, Scene, Start, picture};
use serde::Serialize;
use std::io::{IsTerminal, Write, stderr, stdin};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

/// 20 Hz.
const STEP: Duration = Duration::from_millis(50);
/// A step that begins so much too late is counted.
const LATE: Duration = Duration::from_millis(10);

/// How well the pace was kept.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Pace {
    /// Control steps of 50 ms, those included in which the world waits.
    pub steps: usize,
    /// Begun more than 10 ms too late.
    pub late: usize,
    /// How much too late the worst of them began, ms.
    pub worst_late_ms: f64,
    /// Frames that were drawn.
    pub pictures: u32,
    /// From the first step to the end, s.
    pub secs: f64,
}

/// Makes sure that stdin and stderr are terminals, before anything long begins.
///
/// # Errors
/// When keys cannot come in, or pictures not go out.
pub fn needed() -> Result<()> {
    for (name, there) in [("stdin", stdin().is_terminal()), ("stderr", stderr().is_terminal())] {
        if !there {
            return Err(Failure::new(
                "tele-operation needs a terminal: keys come from it, the picture goes to it",
                format!("{name} is no terminal"),
                "run it in a terminal, without pipes; or --expert scripted",
            ));
        }
    }
    Ok(())
}

/// A terminal in raw mode; dropped, it is as it was.
pub struct Console {
    /// Whether it tells when keys go up.
    pub releases: bool,
}

impl Console {
    /// Takes the terminal over: raw mode, the alternate screen, no cursor, and key releases where
    /// it can tell them.
    ///
    /// # Errors
    /// When there is no terminal, or it refuses.
    pub fn open() -> Result<Self> {
        needed()?;
        let unusable = |e: std::io::Error| {
            let hint = "another terminal; or --expert scripted";
            Failure::new(format!("the terminal cannot be used: {e}"), "raw mode", hint)
        };
        terminal::enable_raw_mode().map_err(unusable)?;
        let console = Self { releases: matches!(terminal::supports_keyboard_enhancement(), Ok(true)) };
        execute!(stderr(), terminal::EnterAlternateScreen, cursor::Hide, EnableFocusChange).map_err(unusable)?;
        if console.releases {
            let flags = KeyboardEnhancementFlags::DISAMBIGUATE_ESCAPE_CODES
                | KeyboardEnhancementFlags::REPORT_EVENT_TYPES
                | KeyboardEnhancementFlags::REPORT_ALL_KEYS_AS_ESCAPE_CODES;
            execute!(stderr(), PushKeyboardEnhancementFlags(flags)).map_err(unusable)?;
        }
        Ok(console)
    }
}

impl Drop for Console {
    fn drop(&mut self) {
        if self.releases {
            let _ = execute!(stderr(), PopKeyboardEnhancementFlags);
        }
        let _ = execute!(stderr(), DisableFocusChange, cursor::Show, terminal::LeaveAlternateScreen);
        let _ = terminal::disable_raw_mode();
    }
}

/// Drives `session` until the person quits or `wanted` episodes are kept, those from before
/// included; `save` is called with all of them whenever they changed. Needs an open [`Console`];
/// `scene` is the session's own, for pictures.
///
/// # Errors
/// When saving fails, the terminal is gone, or the person stops it (Ctrl-C).
pub fn drive(
    session: &mut Session,
    scene: &Scene,
    wanted: usize,
    save: impl FnMut(&Demos) -> Result<()>,
    progress: &Progress,
) -> Result<Pace> {
    let pictures = AtomicU32::new(0);
    let (sender, receiver) = channel();
    let pace = std::thread::scope(|scope| {
        scope.spawn(|| paint(scene, receiver, wanted, &pictures));
        // The sender ends with the control loop, and the painter with the sender.
        control(session, sender, wanted, save, progress)
    })?;
    Ok(Pace { pictures: pictures.into_inner(), ..pace })
}

/// A step every 50 ms, key events as they come.
fn control(
    session: &mut Session,
    shown: Sender<(Start, Status)>,
    wanted: usize,
    mut save: impl FnMut(&Demos) -> Result<()>,
    progress: &Progress,
) -> Result<Pace> {
    let events = Events::listen();
    let begun = Instant::now();
    let mut pace = Pace::default();
    let mut next = begun + STEP;
    while !session.wants_to_quit() && session.demos.episodes.len() < wanted {
        // The painter is gone only when it panicked; the scope tells that.
        let _ = shown.send((session.shown(), session.status()));
        while let Some(event) = events.until(next)? {
            match event {
                Event::Key(k) if k.code == KeyCode::Char('c') && k.modifiers.contains(KeyModifiers::CONTROL) => {
                    return Err(Cancelled.into());
                }
                Event::Key(k) => {
                    if let Some(key) = meaning(k.code) {
                        session.key(key, stroke(k.kind), begun.elapsed());
                    }
                }
                Event::FocusLost => session.let_go(),
                _ => {}
            }
        }
        progress.check()?;
        let late = next.elapsed();
        pace.late += usize::from(late > LATE);
        pace.worst_late_ms = pace.worst_late_ms.max(1e3 * late.as_secs_f64());
        pace.steps += 1;
        // After a hold-up the pace begins anew: steps are never made up for in a hurry.
        next = if late > STEP { Instant::now() + STEP } else { next + STEP };
        session.step(begun.elapsed())?;
        if session.take_changed() {
            save(&session.demos)?;
        }
    }
    pace.secs = begun.elapsed().as_secs_f64();
    Ok(pace)
}

/// Terminal events from a thread of their own: of a terminal that hung up crossterm reads nothing
/// for ever, and the control loop has to notice the hang-up's signal all the same.
struct Events {
    receiver: Receiver<std::io::Result<Event>>,
    /// The thread ends with it.
    _listening: Arc<()>,
}

impl Events {
    fn listen() -> Self {
        let ((sender, receiver), listening) = (channel(), Arc::new(()));
        let wanted = Arc::downgrade(&listening);
        std::thread::spawn(move || {
            while wanted.upgrade().is_some() {
                let event = match event::poll(STEP) {
                    Ok(false) => continue,
                    Ok(true) => event::read(),
                    Err(e) => Err(e),
                };
                let failed = event.is_err();
                if sender.send(event).is_err() || failed {
                    return;
                }
            }
        });
        Self { receiver, _listening: listening }
    }

    /// The next event; `None` when there is none before `deadline`.
    fn until(&self, deadline: Instant) -> Result<Option<Event>> {
        match self.receiver.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
            Ok(event) => event.map(Some).map_err(lost),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(lost(std::io::ErrorKind::BrokenPipe.into())),
        }
    }
}

/// Draws the newest of what comes until nothing comes any more.
fn paint(scene: &Scene, newest: Receiver<(Start, Status)>, wanted: usize, pictures: &AtomicU32) {
    let mut env = Env::new(scene);
    let mut last = Instant::now();
    let mut rate = 0.0;
    while let Ok(mut shown) = newest.recv() {
        while let Ok(newer) = newest.try_recv() {
            shown = newer;
        }
        let (start, status) = shown;
        let (columns, rows) = terminal::size().unwrap_or((80, 24));
        let (columns, rows) = (usize::from(columns), usize::from(rows));
        let drawn = match (screen::picture_sizes(columns, rows), env.start_from(&start)) {
            (Some((widths, height)), Ok(())) => {
                let side = picture::take(&mut env, &picture::SIDE, widths[0], height);
                let front = picture::take(&mut env, &picture::FRONT, widths[1], height);
                screen::half_blocks(&screen::beside(&side, &front, widths), widths[0] + 1 + widths[1])
            }
            _ => String::new(),
        };
        // A mean over about ten pictures.
        rate += 0.1 * (1.0 / last.elapsed().as_secs_f64().max(1e-3) - rate);
        last = Instant::now();
        let text = screen::frame(&drawn, &screen::status_lines(&status, wanted, rate), columns);
        let mut out = stderr().lock();
        // A terminal that is gone is noticed by the control loop.
        let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
        pictures.fetch_add(1, Ordering::Relaxed);
    }
}

fn lost(e: std::io::Error) -> Failure {
    let hint = "run the same command again: what was kept is in the file";
    Failure::new(format!("the terminal is gone: {e}"), "keyboard", hint)
}

fn stroke(kind: KeyEventKind) -> Stroke {
    match kind {
        KeyEventKind::Press => Stroke::Down,
        KeyEventKind::Repeat => Stroke::Again,
        KeyEventKind::Release => Stroke::Up,
    }
}

/// Letters as in robosuite's keyboard, directions as the picture shows them.
fn meaning(code: KeyCode) -> Option<Key> {
    let go = |axis, forward| Some(Key::Move { axis, forward });
    match code {
        KeyCode::Left => go(0, false),
        KeyCode::Right => go(0, true),
        KeyCode::Down => go(1, false),
        KeyCode::Up => go(1, true),
        KeyCode::PageDown => go(2, false),
        KeyCode::PageUp => go(2, true),
        KeyCode::Enter => Some(Key::Command(Command::Record)),
        KeyCode::Backspace => Some(Key::Command(Command::Discard)),
        KeyCode::Delete => Some(Key::Command(Command::TakeBack)),
        KeyCode::Char(c) => match c.to_ascii_lowercase() {
            'a' => go(0, false),
            'd' => go(0, true),
            's' => go(1, false),
            'w' => go(1, true),
            'f' => go(2, false),
            'r' => go(2, true),
            'z' => go(3, false),
            'x' => go(3, true),
            't' => go(4, false),
            'g' => go(4, true),
            'c' => go(5, false),
            'v' => go(5, true),
            ' ' => Some(Key::Gripper),
            '+' | '=' => Some(Key::Faster),
            '-' | '_' => Some(Key::Slower),
            'u' => Some(Key::Command(Command::Undo)),
            'q' => Some(Key::Command(Command::Quit)),
            _ => None,
        },
        _ => None,
    }
}
