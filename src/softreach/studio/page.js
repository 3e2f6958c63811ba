// What viser's page lacks: when fields apply, which keys are the scene's, and names of controls.
{
const listen = (kind, call) => addEventListener(kind, call, true);

// viser drops what a field tells if Enter follows at once; and fields that are left apply too.
const apply = form => {
  form.typed = false;
  setTimeout(() => form.isConnected && form.requestSubmit(), 120);
};
listen("input", ({target: {form}}) => { if (form) form.typed = true; });
listen("focusin", ({target}) => { if (target.form) target.form.before = target.value; });
listen("focusout", ({target: {form}}) => { if (form && form.typed) apply(form); });
listen("keydown", event => {
  const field = event.target, form = field.form;
  if (!form) return;
  if (event.key === "Enter") {
    event.preventDefault();
    event.stopPropagation();
    apply(form);
  } else if (event.key === "Escape" && form.before !== undefined) {
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set.call(field, form.before);
    field.dispatchEvent(new Event("input", {bubbles: true}));
    form.typed = false;
  }
});

// A new tab is dark where the system is: the request for its socket says so.
const dark = matchMedia("(prefers-color-scheme: dark)").matches;
document.cookie = `softreach_dark=${Number(dark)}; path=/; SameSite=Lax`;

// viser turns its camera with every key that is not typed into a field. Keys of a slider, a tab or a
// button are its own, as are arrows where they scroll; those with Ctrl are commands.
document.documentElement.addEventListener("keydown", event => {
  const target = event.target, own = target.closest?.("[role=slider], [role=tab], button");
  const scrolls = target.matches?.("[data-scrolls]") && event.key.startsWith("Arrow");
  if ((own || scrolls) && !event.ctrlKey && !event.metaKey) event.stopPropagation();
});

// Ctrl+Z and Ctrl+Shift+Z press the buttons Undo and Redo, but not while one types.
listen("keydown", event => {
  if (!(event.ctrlKey || event.metaKey) || event.altKey || event.key.toLowerCase() !== "z") return;
  if (event.target.closest?.("input, textarea, select")) return;
  const step = event.shiftKey ? "redo" : "undo", buttons = [...document.querySelectorAll("button")];
  const button = buttons.find(each => each.textContent.toLowerCase() === step);
  if (!button) return;
  event.preventDefault();
  button.click();
});

// Screen readers hear the label in front of a control; pictures have the text of their folder. What
// scrolls is reached by keys. `--panel` is how wide the panel is, for tooltips beside it.
const name = () => {
  let label = "";
  for (const control of document.querySelectorAll("label, [role=slider], input, button")) {
    const text = control.textContent.trim();
    if (control.tagName === "LABEL") label = text || label;
    else if (control.ariaLabel || text) continue;
    else if (control.tagName === "BUTTON") control.ariaLabel = "close";
    else if (label) control.ariaLabel = label;
  }
  for (const picture of document.querySelectorAll("img")) {
    let around = picture.parentElement;
    while (around && !around.textContent.trim()) around = around.parentElement;
    if (around) picture.alt = around.textContent.trim();
  }
  for (const area of document.querySelectorAll("[data-scrollarea-viewport]")) {
    if (area.querySelector("button, input, a, [tabindex]")) continue;
    Object.assign(area, {tabIndex: 0, role: "group", ariaLabel: "figures"});
    area.dataset.scrolls = "";
  }
  const status = document.querySelector("[data-softreach]");
  if (!status) return;
  const panel = Math.round(innerWidth - status.getBoundingClientRect().left + 10);
  document.documentElement.style.setProperty("--panel", `${panel}px`);
};
let waiting = false;
new MutationObserver(() => {
  if (!waiting) setTimeout(() => { waiting = false; name(); }, 60);
  waiting = true;
}).observe(document.documentElement, {childList: true, subtree: true});

// viser's own notices are hidden; what a person has to know of the page itself stands above the scene.
const banner = text => Object.assign(document.createElement("div"), {
  className: "sr-banner", role: "alert", textContent: text,
});
const gone = banner("The server of this page is gone. The page goes on once it answers again.");
const blind = banner("This browser draws no scene: switch WebGL on in its settings, and reload.");
window.Worker = class extends Worker {  // one of viser's holds the socket
  constructor(...given) {
    super(...given);
    this.addEventListener("message", ({data}) => {
      if (data?.type === "closed") document.body.append(gone);
      if (data?.type === "connected") gone.remove();
    });
  }
};

const context = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, options) {
  const drawn = context.call(this, kind, options);
  if (kind === "webgl2" && !drawn) document.body.append(blind);
  return drawn;
};

// While a node is dragged, viser tells where the mouse is after 50 ms and the picture that follows: 7 to
// 9 times a second. Here it is told at every move, of which browsers make one a picture.
const wait = window.setTimeout;
let held = false;
for (const kind of ["pointerdown", "pointerup", "pointercancel"])
  listen(kind, event => { held = kind === "pointerdown" && event.target.tagName === "CANVAS"; });
window.setTimeout = function (call, delay) {
  if (!held || delay !== 50) return wait.apply(window, arguments);
  queueMicrotask(call);
  return 0;
};
}
