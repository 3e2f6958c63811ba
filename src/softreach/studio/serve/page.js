// What viser's page lacks: when fields apply, which keys are the scene's, and letters on dark ground.

// viser drops what a field tells if Enter follows at once; and fields that are left apply too.
(function () {
  function apply(form) {
    form.typed = false;
    setTimeout(function () {
      if (form.isConnected) form.requestSubmit();
    }, 120);
  }
  addEventListener("input", function (event) {
    if (event.target.form) event.target.form.typed = true;
  }, true);
  addEventListener("keydown", function (event) {
    var form = event.target.form;
    if (form && event.key === "Enter") {
      event.preventDefault();
      event.stopPropagation();
      apply(form);
    }
  }, true);
  addEventListener("focusin", function (event) {
    if (event.target.form) event.target.form.before = event.target.value;
  }, true);
  addEventListener("keydown", function (event) {
    var field = event.target;
    if (event.key !== "Escape" || !field.form || field.form.before === undefined) return;
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set.call(
      field, field.form.before);
    field.dispatchEvent(new Event("input", { bubbles: true }));
    field.form.typed = false;
  }, true);
  addEventListener("focusout", function (event) {
    var form = event.target.form;
    if (form && form.typed) apply(form);
  }, true);
})();

// viser turns its camera with every key that is not typed into a field. Keys of a slider, a tab or a
// button are its own; those with Ctrl are commands.
document.documentElement.addEventListener("keydown", function (event) {
  var own = event.target.closest && event.target.closest("[role=slider], [role=tab], button");
  if (own && !event.ctrlKey && !event.metaKey) event.stopPropagation();
});

// Keys of the page, in one table: how a key is written, what it does, and what is done here, if
// anything. The rest is viser's, or a command of the studio's.
(function () {
  var keys = [
    ["1 \u2026 8", "choose a tab", /^[1-8]$/, chooseTab],
    ["Ctrl+Z, Ctrl+Shift+Z", "undo, redo"],
    ["Enter, Esc in a field", "apply what is typed, restore what was there"],
    ["W A S D, Q E, arrows", "move the camera"],
    ["?", "show this table, or hide it", /^\?$/, toggleTable],
  ];

  function chooseTab(key) {
    var lists = [...document.querySelectorAll("[role=tablist]")].map(function (list) {
      return list.querySelectorAll("[role=tab]");
    });
    lists.sort(function (one, other) { return other.length - one.length; });
    var enter = new KeyboardEvent("keydown", { key: "Enter", bubbles: true }); // to a click it is deaf
    if (lists[0] && lists[0][key - 1]) lists[0][key - 1].dispatchEvent(enter);
  }

  function toggleTable() {
    var shown = document.querySelector("dialog.keys");
    if (shown) shown.close();
    else tableOfKeys().showModal();
  }

  function tableOfKeys() {
    var dialog = document.createElement("dialog"), table = document.createElement("table");
    dialog.className = "keys";
    dialog.setAttribute("aria-label", "keys");
    keys.forEach(function (key) {
      var row = table.insertRow();
      row.insertCell().textContent = key[0];
      row.insertCell().textContent = key[1];
    });
    dialog.append(table);
    dialog.addEventListener("click", function () { dialog.close(); });
    dialog.addEventListener("close", function () { dialog.remove(); });
    return document.body.appendChild(dialog);
  }

  addEventListener("keydown", function (event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (!document.querySelector("[data-history]")) return; // a page that was saved has no tabs
    if (event.target.closest && event.target.closest("input, textarea, select, [role=slider]")) return;
    keys.forEach(function (key) {
      if (!key[2] || !key[2].test(event.key)) return;
      event.preventDefault();
      event.stopPropagation();
      key[3](event.key);
    });
  }, true);
})();

// What changes with the page: names of controls, which steps can be undone, how wide the panel is.
(function () {
  // Readers of screens hear the label in front of a control; buttons that are pictures get words.
  function name() {
    var label = "";
    document.querySelectorAll("label, [role=slider], input, button").forEach(function (control) {
      if (control.tagName === "LABEL") label = control.textContent.trim() || label;
      else if (control.getAttribute("aria-label") || control.textContent.trim()) return;
      else if (control.tagName === "BUTTON") {
        var picture = control.innerHTML;
        var words = control.className.includes("CloseButton") ? "close"
          : picture.includes("search") ? "commands" : "settings of the viewer";
        control.setAttribute("aria-label", words);
      } else if (label) control.setAttribute("aria-label", label);
    });
  }
  var waiting = false;
  function tidy() {
    waiting = false;
    name();
    var status = document.querySelector("[data-history]");
    if (!status) return;
    var steps = status.dataset.history;
    document.querySelectorAll("button").forEach(function (button) {
      var step = button.textContent.toLowerCase();
      if (step === "undo" || step === "redo") button.disabled = !steps.includes(step);
    });
    var panel = innerWidth - status.getBoundingClientRect().left;
    document.documentElement.style.setProperty("--panel", Math.round(panel + 10) + "px");
  }
  new MutationObserver(function () {
    if (!waiting) setTimeout(tidy, 60);
    waiting = true;
  }).observe(document.documentElement, { childList: true, subtree: true });
})();

// viser writes black on white whatever the page looks like; its two shaders for that get a switch.
(function () {
  var gl = window.WebGL2RenderingContext && WebGL2RenderingContext.prototype;
  if (!gl) return;
  var source = gl.shaderSource, attach = gl.attachShader, use = gl.useProgram;
  var shaders = new WeakSet(), programs = new WeakMap();
  gl.shaderSource = function (shader, text) {
    var ours = text
      .replace("vec4(1.0, 1.0, 1.0, 0.85 * vAlpha)",
               "vec4(vec3(1.0 - 0.92 * isDark), 0.85 * vAlpha)")
      .replace("vec4(0.0, 0.0, 0.0, a)", "vec4(vec3(0.85 * isDark), a)");
    if (ours !== text) {
      shaders.add(shader);
      ours = ours.replace("void main", "uniform float isDark; void main");
    }
    source.call(this, shader, ours);
  };
  gl.attachShader = function (program, shader) {
    if (shaders.has(shader)) programs.set(program, null);
    attach.call(this, program, shader);
  };
  gl.useProgram = function (program) {
    use.call(this, program);
    if (!program || !programs.has(program)) return;
    var place = programs.get(program) || this.getUniformLocation(program, "isDark");
    programs.set(program, place);
    this.uniform1f(place, document.documentElement.dataset.mantineColorScheme === "dark" ? 1 : 0);
  };
})();
